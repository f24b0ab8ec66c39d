"""What to draw, as plain data: bodies, how they move, the ground, the part of the world to show.

A domain turns a trajectory into a `Scene`; the stage turns two scenes into one animated clip. Neither
knows the other. Scene coordinates: x to the right of travel, y along it (the long side of the picture), z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class Mesh:
    """Triangles of one colour.

    Attributes:
        vertices: Corner positions in scene units, shape `(n_vertices, 3)`.
        triangles: Indices into `vertices`, counter-clockwise seen from outside, shape `(n_triangles, 3)`.
        colour: sRGB hex colour such as `#1f5fd0`.
    """

    vertices: Float[np.ndarray, "n_vertices 3"]
    triangles: Int[np.ndarray, "n_triangles 3"]
    colour: str


@dataclass(frozen=True)
class Body:
    """A rigid thing with a look; its own front points along +y and its origin lies on the ground."""

    name: str
    meshes: tuple[Mesh, ...]


@dataclass(frozen=True)
class Track:
    """How one body moves.

    Attributes:
        body: The body that moves.
        positions: Position of its origin at each frame, shape `(n_frames, 3)`.
        yaws_rad: Turn about +z from the body's own front (+y), counter-clockwise, shape `(n_frames,)`.
    """

    body: Body
    positions: Float[np.ndarray, "n_frames 3"]
    yaws_rad: Float[np.ndarray, " n_frames"]


@dataclass(frozen=True)
class Bounds:
    """The rectangle of the ground that holds everything worth seeing, bodies' full size included."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    def union(self, other: Bounds) -> Bounds:
        """Returns the smallest bounds that hold both."""
        return Bounds(
            min(self.x_min, other.x_min),
            max(self.x_max, other.x_max),
            min(self.y_min, other.y_min),
            max(self.y_max, other.y_max),
        )


@dataclass(frozen=True)
class Scene:
    """One side of a query: what moves, on what ground, how fast, and what to frame.

    Attributes:
        tracks: One per body; all have the same number of frames.
        ground: Meshes that never move (road, markings, grass tufts), as tall as they should look.
        dt_s: Seconds between frames.
        bounds: What the camera must show for the whole length of the trajectory.
        background: sRGB hex colour beyond all ground meshes (grass, floor).
    """

    tracks: tuple[Track, ...]
    ground: tuple[Mesh, ...]
    dt_s: float
    bounds: Bounds
    background: str
