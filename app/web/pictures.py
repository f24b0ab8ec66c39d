"""Trajectories as still pictures: each seen from above, with the bodies where they are every so often."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from jaxtyping import Float
from markupsafe import Markup

from study_core.domain import Domain
from study_core.scene import Bounds, Mesh, Scene, Track

_EVERY_S = 0.8
# Later is stronger, so that the eye follows the way.
_FAINTEST = 0.22
# Ground before and after everything that happens, in scene units.
_MARGIN = 0.1
# Body parts no larger than this, in scene units squared, can't be seen at the size of the picture.
_SMALLEST = 2e-5


@dataclass(frozen=True)
class _View:
    """Which part of the ground the picture shows: y runs to the right, x downwards."""

    bounds: Bounds

    @property
    def size(self) -> tuple[float, float]:
        bounds = self.bounds
        return bounds.y_max - bounds.y_min, bounds.x_max - bounds.x_min

    def path(self, triangles: Float[np.ndarray, "n 3 3"]) -> str:
        """Returns triangles as the data of an SVG path, in thousandths."""
        x, y = triangles[..., 0], triangles[..., 1]
        across = np.round((y - self.bounds.y_min) * 1000).astype(int)
        down = np.round((x - self.bounds.x_min) * 1000).astype(int)
        corners = zip(across.tolist(), down.tolist(), strict=True)
        return "".join(
            "M" + "L".join(f"{a} {d}" for a, d in zip(*three, strict=True)) + "Z" for three in corners
        )


def pictures_of(domain: Domain, drives: Sequence[Float[np.ndarray, " n_controls"]]) -> list[Markup]:
    """Returns one picture for each trajectory, as inline SVG; all show the same part of the ground.

    Args:
        domain: Whose trajectories they are.
        drives: Their controls.
    """
    scenes = [domain.scene(controls) for controls in drives]
    bounds = reduce(Bounds.union, (scene.bounds for scene in scenes))
    bounds = replace(bounds, y_min=bounds.y_min - _MARGIN, y_max=bounds.y_max + _MARGIN)
    return [_picture(scene, _View(bounds)) for scene in scenes]


def _picture(scene: Scene, view: _View) -> Markup:
    width, height = (round(1000 * side) for side in view.size)
    # What it shows is said beside it.
    start = (
        f'<svg class="drive" viewBox="0 0 {width} {height}" aria-hidden="true" focusable="false">'
        f'<rect width="{width}" height="{height}" fill="{scene.background[:7]}"/>'
    )
    ground = (_drawn(view, _within(mesh, view.bounds), mesh.colour) for mesh in scene.ground)
    # Everything in it is a number or a colour of the domain's, which its contract holds to hexadecimal digits.
    return Markup(start + "".join([*ground, *_bodies(scene, view)]) + "</svg>")


def _bodies(scene: Scene, view: _View) -> Iterator[str]:
    """Gives every body at each of the moments, the last ones on top."""
    n_frames = len(scene.tracks[0].positions)
    every = max(1, round(_EVERY_S / scene.dt_s))
    moments = list(range((n_frames - 1) % every, n_frames, every))
    for number, frame in enumerate(moments, start=1):
        opacity = _FAINTEST + (1.0 - _FAINTEST) * (number / len(moments)) ** 2
        # The bodies stand on the ground: who is nearer to the eye can't be told from above.
        drawn = "".join(_body(view, track, frame) for track in reversed(scene.tracks))
        yield f'<g opacity="{opacity:.2f}">{drawn}</g>'


def _body(view: _View, track: Track, frame: int) -> str:
    yaw = track.yaws_rad[frame]
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    drawn = []
    for mesh in sorted(track.body.meshes, key=lambda mesh: float(mesh.vertices[:, 2].max())):
        triangles = _seen(mesh.vertices[mesh.triangles])
        drawn.append(_drawn(view, triangles @ turn + track.positions[frame], mesh.colour))
    return "".join(drawn)


def _seen(triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Returns the triangles that face upwards and are large enough to be seen."""
    edges = triangles[:, 1:, :2] - triangles[:, :1, :2]
    areas = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    seen: np.ndarray = triangles[areas > _SMALLEST]
    return seen


def _within(mesh: Mesh, bounds: Bounds) -> Float[np.ndarray, "m 3 3"]:
    """Returns the triangles of the ground that the picture shows a part of."""
    triangles = mesh.vertices[mesh.triangles]
    least, most = triangles.min(axis=1), triangles.max(axis=1)
    across = (most[:, 0] >= bounds.x_min) & (least[:, 0] <= bounds.x_max)
    along = (most[:, 1] >= bounds.y_min) & (least[:, 1] <= bounds.y_max)
    shown: np.ndarray = triangles[across & along]
    return shown


def _drawn(view: _View, triangles: Float[np.ndarray, "n 3 3"], colour: str) -> str:
    if len(triangles) == 0:
        return ""
    opacity = f' fill-opacity="{int(colour[7:9], 16) / 255:.2f}"' if len(colour) == 9 else ""
    return f'<path fill="{colour[:7]}"{opacity} d="{view.path(triangles)}"/>'
