"""Where the two sides of a picture lie, and the camera that sees them. Pure.

The world of a picture is the picture itself: x to the right, y up, z towards the viewer, the visible height
is 2. One fixed camera looks at it from far away with a very narrow field of view, so that perspective can't
favour a side and nothing about the camera ever changes between queries. Everything that depends on a query
is in the two `Placement`s, which turn a scene's coordinates into the picture's. Both have the same scale and
the same rotation, hence the same depth; they differ by a shift inside the picture's plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from math import ceil, cos, floor, log, radians, sin, sqrt, tan

import numpy as np
from jaxtyping import Float

from study_core.scene import Bounds

GUTTER = 0.028
"""Width of the strip between the sides, which the page draws over the middle of the picture (participant.css)."""

_MARGIN = 0.03
_TALLEST = 0.13
"""Room above the ground for the bodies' own height, in scene units."""
_SNAP_ALONG = 0.5
_SNAP_ACROSS = 0.25
_LONGEST_USUAL = 5.0
_SHORTEST = 1.25
_HALF_WIDTH_AT_LEAST = 0.35


class Layout(Enum):
    """How the sides are arranged; each member's value is its name on the wire."""

    WIDE = "wide"
    """A above B, travel from left to right."""
    TALL = "tall"
    """A left of B, travel upwards."""

    @property
    def aspect(self) -> float:
        """Width of the picture over its height; the page gives its pane exactly this shape."""
        return 1.85 if self is Layout.WIDE else 0.68


@dataclass(frozen=True)
class Camera:
    """The one camera, in picture coordinates.

    Attributes:
        position: Where it stands.
        look_at: The middle of the picture.
        up: Its upward direction.
        fov_rad: Vertical field of view.
        near: Distance of the near plane.
        far: Distance of the far plane.
    """

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    up: tuple[float, float, float]
    fov_rad: float
    near: float
    far: float


def _camera(fov_deg: float) -> Camera:
    distance = 1.0 / tan(radians(fov_deg) / 2)
    return Camera(
        (0.0, 0.0, distance),
        (0.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        radians(fov_deg),
        distance - 12.0,
        distance + 12.0,
    )


# A fifth of a degree: near enough to a parallel projection that the sides' heights agree to 0.1 %, which is
# less than a tenth of a pixel on a car; far enough from one that 32-bit depths still separate the road's layers.
CAMERA = _camera(0.2)


@dataclass(frozen=True)
class Placement:
    """A similarity: picture point = offset + scale * rotation @ scene point.

    Attributes:
        scale: Picture units per scene unit.
        rotation: Rows are the picture's right, up and towards-the-viewer in scene coordinates, shape `(3, 3)`.
        offset: Where the scene's origin comes to lie, shape `(3,)`.
    """

    scale: float
    rotation: Float[np.ndarray, "3 3"]
    offset: Float[np.ndarray, " 3"]

    def apply(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Turns scene points into picture points."""
        placed: Float[np.ndarray, "n 3"] = self.offset + self.scale * points @ self.rotation.T
        return placed


@dataclass(frozen=True)
class Framing:
    """Where both sides of one picture lie."""

    layout: Layout
    a: Placement
    b: Placement


def _rotation(layout: Layout) -> Float[np.ndarray, "3 3"]:
    """Looks down at the road from its right side (wide) or from behind (tall)."""
    # Wide pictures have height to spare, so a steep view shows positions across the road best. In tall ones
    # the length of the drive fills the height; a flatter view shortens it, which makes everything larger.
    e = radians(58.0 if layout is Layout.WIDE else 38.0)
    if layout is Layout.WIDE:
        return np.array([[0.0, 1.0, 0.0], [-sin(e), 0.0, cos(e)], [cos(e), 0.0, sin(e)]])
    return np.array([[1.0, 0.0, 0.0], [0.0, sin(e), cos(e)], [0.0, -cos(e), sin(e)]])


def half_extents(layout: Layout) -> Float[np.ndarray, " 2"]:
    """Half the width and half the height of what is seen of one side: from the gutter to the picture's edge."""
    if layout is Layout.WIDE:
        return np.array([layout.aspect, 0.5 - GUTTER / 4])
    return np.array([layout.aspect / 2 - GUTTER / 4, 1.0])


def half_centres(layout: Layout) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Centres of A's and B's half in picture coordinates."""
    # The outer edges are those of the picture.
    left, up = np.array([layout.aspect, 1.0]) - half_extents(layout)
    centre = np.array([-left, up, 0.0])
    return centre, -centre


def _snapped_up(distance: float) -> float:
    """The next line of the coarse grid, or the standard half width where that suffices."""
    return max(
        _HALF_WIDTH_AT_LEAST,
        ceil(distance / _SNAP_ACROSS) * _SNAP_ACROSS if distance > _HALF_WIDTH_AT_LEAST else 0.0,
    )


def _steady_length(bounds: Bounds) -> tuple[float, float]:
    """Widens the bounds along the road to one of few standard stretches.

    Lengths come in steps of a factor of the square root of two around the usual longest drive, so that the
    picture seldom jumps between queries, and something that hardly moves isn't shown gigantic.
    """
    y_min = floor(bounds.y_min / _SNAP_ALONG) * _SNAP_ALONG
    needed = max(bounds.y_max - y_min, _SHORTEST)
    # The small constant forgives rounding when a length is exactly a rung.
    rung = ceil(log(needed / _LONGEST_USUAL) / log(sqrt(2.0)) - 1e-9)
    return y_min, y_min + _LONGEST_USUAL * sqrt(2.0) ** rung


def _shown(bounds: Bounds, layout: Layout) -> Bounds:
    """What the picture shows: the standard stretch with the scene's middle line centred, if that holds it.

    Only a drive that strays further across makes the picture shift and shrink, in coarse steps.
    """
    y = _steady_length(bounds)
    usual = Bounds(-_HALF_WIDTH_AT_LEAST, _HALF_WIDTH_AT_LEAST, *y)
    reach = max(_HALF_WIDTH_AT_LEAST, -bounds.x_min, bounds.x_max)
    centred = Bounds(-reach, reach, *y)
    if _fit(centred, layout)[0] == _fit(usual, layout)[0]:
        return centred
    return Bounds(-_snapped_up(-bounds.x_min), _snapped_up(bounds.x_max), *y)


def _fit(bounds: Bounds, layout: Layout) -> tuple[float, Float[np.ndarray, " 3"]]:
    """The largest scale at which bounds fill a half, and their middle in the picture's axes at scale 1."""
    corners = np.array(
        [
            (x, y, z)
            for x in (bounds.x_min, bounds.x_max)
            for y in (bounds.y_min, bounds.y_max)
            for z in (0.0, _TALLEST)
        ]
    )
    seen = corners @ _rotation(layout).T
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = float(np.min((1 - _MARGIN) * 2 * half_extents(layout) / (high - low)[:2]))
    return scale, (low + high) / 2


@lru_cache(maxsize=64)
def frame(bounds: Bounds, layout: Layout) -> Framing:
    """Shows everything inside the bounds, on both sides, as large as the layout permits.

    Args:
        bounds: Union of both scenes' bounds.
        layout: Arrangement of the sides.

    Returns:
        Placements of A and B, equal but for their shift.
    """
    scale, middle = _fit(_shown(bounds, layout), layout)
    rotation = _rotation(layout)
    # Towards the viewer, only where the ground lies: through the middle of the half, in every picture.
    middle[2] = ground_height(middle[1], layout)
    placements = (Placement(scale, rotation, centre - scale * middle) for centre in half_centres(layout))
    return Framing(layout, *placements)


def ground_height(up: float, layout: Layout) -> float:
    """Returns how far towards the viewer the ground lies, in picture units, above or below the middle of a half.

    Args:
        up: How far above the middle, in picture units.
        layout: Tells how steeply one looks down at the ground.
    """
    _, up_part, towards_part = _rotation(layout)[:, 2]
    return float(-up * up_part / towards_part)


def project(points: Float[np.ndarray, "n 3"], layout: Layout) -> Float[np.ndarray, "n 2"]:
    """Projects picture points with the camera's exact perspective.

    Args:
        points: Picture coordinates, shape `(n, 3)`.
        layout: Tells the pane's aspect.

    Returns:
        Position in the pane, -1 at its left and bottom and 1 at its right and top, shape `(n, 2)`.
    """
    distance = CAMERA.position[2]
    on_plane = points[:, :2] * (distance / (distance - points[:, 2:]))
    return on_plane / (layout.aspect, 1.0)
