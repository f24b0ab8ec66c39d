"""What bodies and ground are made of: flat triangles, and layers of them. Pure data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from study_core.scene import Mesh

Triangles: TypeAlias = Float[np.ndarray, "_ 3 3"]
Quad: TypeAlias = Float[np.ndarray, "4 3"]
Point: TypeAlias = tuple[float, float, float] | Float[np.ndarray, "3"]

# Layers of the ground are this far apart, so that a renderer's depth buffer never mixes them up.
LAYER = 0.003


def mesh_of(triangles: Iterable[Triangles], colour: str) -> Mesh:
    """Joins triangles into one mesh; corners aren't shared, which is what flat shading needs."""
    corners = np.concatenate([np.asarray(part, dtype=np.float64) for part in triangles]).reshape(-1, 3)
    indices: Int[np.ndarray, "n 3"] = np.arange(len(corners)).reshape(-1, 3)
    return Mesh(corners, indices, colour)


def quad(corners: Sequence[Point] | Quad) -> Triangles:
    """Two triangles from four corners given counter-clockwise as seen from outside."""
    a, b, c, d = np.asarray(corners, dtype=np.float64)
    return np.array([[a, b, c], [a, c, d]])
