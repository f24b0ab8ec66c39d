"""The road and the grass. Pure data, in the driving model's units (a lane is 0.17 wide)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from study_core.domains.driving.shapes import LAYER, Triangles, mesh_of, quad
from study_core.scene import Bounds, Mesh

BACKGROUND = "#86a86b"
"""The grass, wherever nothing else is drawn."""

_ASPHALT = "#565b61"
_LINE = "#f2f2ea"
_KERB = "#b7b09c"
_GRASS_LIGHT = "#a3c285"
_GRASS_DARK = "#6f9156"
_MEADOW_LIGHT = "#8cae70"
_MEADOW_DARK = "#7fa164"

_ROAD_EDGE = 0.255
_LANE_BORDER = 0.085
_KERB_WIDTH = 0.05
_VERGE = 2.0
_CELL = 4.0


def _strip(x: tuple[float, float], y: tuple[float, float], layer: int) -> Triangles:
    """A flat rectangle that faces up, on the given layer of the ground."""
    z = layer * LAYER
    return quad([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)])


def _dashes(y: tuple[float, float]) -> list[Triangles]:
    """Lane borders, dashed; the pattern is fixed to the world, so that it never shifts with the picture."""
    starts = np.arange(np.floor(y[0] / 0.4) * 0.4, y[1], 0.4)
    return [
        _strip((x - 0.005, x + 0.005), (start, start + 0.18), 3)
        for start in starts
        for x in (-_LANE_BORDER, _LANE_BORDER)
    ]


def _cells(y: tuple[float, float]) -> list[float]:
    """Starts of the stretches of verge; what grows on one depends on it alone, so all pictures agree."""
    return [float(start) for start in np.arange(np.floor(y[0] / _CELL) * _CELL, y[1], _CELL)]


def _beside_road(rng: np.random.Generator, n: int, start: float, nearest: float) -> Float[np.ndarray, "n 3"]:
    """Random points on both verges of one stretch, on the lowest layer."""
    x = rng.choice((-1.0, 1.0), n) * rng.uniform(nearest, _VERGE, n)
    return np.stack([x, start + rng.uniform(0.0, _CELL, n), np.full(n, LAYER)], axis=1)


def _tufts(y: tuple[float, float], seed: int) -> Triangles:
    """Pairs of blades of grass, lying flat."""
    blade = np.array([(0.0, 0.005, 0.0), (-0.045, 0.0, 0.0), (0.0, -0.005, 0.0)])
    parts = []
    for start in _cells(y):
        rng = np.random.default_rng((seed, round(start / _CELL) + 1000))
        feet = _beside_road(rng, 70, start, 0.34)[:, None, :]
        leaning = rng.uniform(-0.9, 0.9, len(feet))
        size = rng.uniform(0.6, 1.2, (len(feet), 1, 1))
        parts += [feet + size * _turned(blade, leaning + spread) for spread in (-0.35, 0.35)]
    return np.concatenate(parts)


def _turned(shape: Float[np.ndarray, "k 3"], angles: Float[np.ndarray, " n"]) -> Triangles:
    """A flat shape at each of several angles."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y, z = shape.T
    return np.stack([c * x - s * y, s * x + c * y, z + 0 * c], axis=2)


def _patches(y: tuple[float, float], seed: int, height: float) -> Triangles:
    """Large, hardly visible patches of another green."""
    angles = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    outline = np.stack([np.cos(angles), 1.6 * np.sin(angles), np.zeros(9)], axis=1)
    parts = []
    for start in _cells(y):
        rng = np.random.default_rng((seed, round(start / _CELL) + 1000))
        for middle in _beside_road(rng, 14, start, 0.55):
            rim = middle + outline * rng.uniform(0.75, 1.0, (9, 1)) * rng.uniform(0.07, 0.2)
            rim[:, 2] = height
            parts.append(np.stack([np.broadcast_to(rim[0], (7, 3)), rim[1:8], rim[2:9]], axis=1))
    return np.concatenate(parts)


@lru_cache(maxsize=16)
def _ground(y_min: float, y_max: float) -> tuple[Mesh, ...]:
    y = (y_min, y_max)
    edge, kerb = _ROAD_EDGE, _ROAD_EDGE + _KERB_WIDTH
    lines = [_strip((s * edge - 0.013 * (s > 0), s * edge + 0.013 * (s < 0)), y, 3) for s in (-1, 1)]
    return (
        mesh_of([_patches(y, 3, 0.2 * LAYER)], _MEADOW_LIGHT),
        mesh_of([_patches(y, 4, 0.6 * LAYER)], _MEADOW_DARK),
        mesh_of([_tufts(y, 5)], _GRASS_LIGHT),
        mesh_of([_tufts(y, 6)], _GRASS_DARK),
        mesh_of([_strip((-kerb, kerb), y, 1)], _KERB),
        mesh_of([_strip((-edge, edge), y, 2)], _ASPHALT),
        mesh_of([*lines, *_dashes(y)], _LINE),
    )


def ground(bounds: Bounds) -> tuple[Mesh, ...]:
    """Road with its markings and verges, one mesh per colour.

    It runs far past both ends of the bounds, further than any picture shows that isn't almost all grass.
    All usual bounds give the very same objects, so that whoever encodes them may remember the result.

    Args:
        bounds: What the picture must show.

    Returns:
        Meshes in drawing order, each layer a little above the one before.
    """
    step = 16.0
    return _ground(
        float(np.floor(bounds.y_min / step) * step - 2 * step),
        float(np.ceil(bounds.y_max / step) * step + 2 * step),
    )
