"""What driving looks like: the two cars, the road and the grass. Pure data; nothing here knows how it is drawn.

Lengths are in the driving model's units (a lane is 0.17 wide, a car about 0.11 by 0.24). The two cars differ
in silhouette as well as in colour, and the colours are Okabe and Ito's blue and vermilion, which people of
every type of colour vision tell apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from study_core.scene import Body, Bounds, Mesh

BACKGROUND = "#86a86b"
"""The grass, wherever nothing else is drawn."""

_Triangles: TypeAlias = Float[np.ndarray, "_ 3 3"]
_Quad: TypeAlias = Float[np.ndarray, "4 3"]
_Point: TypeAlias = tuple[float, float, float] | Float[np.ndarray, "3"]
_Ring: TypeAlias = tuple[float, float, float, float, float]
"""A cross-section `(y, half width at the bottom, half width at the top, z of the bottom, z of the top)`."""

_BLUE = "#0e6fc4"
_VERMILION = "#dc5a12"
_GLASS = "#1b2632"
_WINDSCREEN = "#b4dcf0"
_TYRE = "#17191c"
_HUB = "#c3c9cf"
_TRIM = "#2b3138"
_HEADLIGHT = "#fffbe6"
_TAIL_LIGHT = "#c4001c"
_PLATE = "#f4f4ee"
_SHADOW = "#00000055"

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
# Layers of the ground are this far apart, so that a renderer's depth buffer never mixes them up.
_LAYER = 0.003


def _mesh(triangles: Iterable[_Triangles], colour: str) -> Mesh:
    """Joins triangles into one mesh; corners aren't shared, which is what flat shading needs."""
    corners = np.concatenate([np.asarray(part, dtype=np.float64) for part in triangles]).reshape(-1, 3)
    indices: Int[np.ndarray, "n 3"] = np.arange(len(corners)).reshape(-1, 3)
    return Mesh(corners, indices, colour)


def _quad(corners: Sequence[_Point] | _Quad) -> _Triangles:
    """Two triangles from four corners given counter-clockwise as seen from outside."""
    a, b, c, d = np.asarray(corners, dtype=np.float64)
    return np.array([[a, b, c], [a, c, d]])


def _mirrored(triangles: _Triangles) -> _Triangles:
    """The same triangles on the car's other side, still facing outwards."""
    return (triangles * (-1.0, 1.0, 1.0))[:, ::-1]


def _both_sides(triangles: _Triangles) -> _Triangles:
    return np.concatenate([triangles, _mirrored(triangles)])


def _corners(ring: _Ring) -> _Quad:
    """Corners of a cross-section: bottom right, top right, top left, bottom left (seen from behind)."""
    y, bottom, top, z_bottom, z_top = ring
    return np.array([(bottom, y, z_bottom), (top, y, z_top), (-top, y, z_top), (-bottom, y, z_bottom)])


def _loft(rings: Sequence[_Ring]) -> _Triangles:
    """A closed hull through cross-sections that are given from the back to the front."""
    sections = [_corners(ring) for ring in rings]
    parts = [_quad(sections[0]), _quad(sections[-1][::-1])]
    for back, front in pairwise(sections):
        for i in range(4):
            j = (i + 1) % 4
            parts.append(_quad([back[i], front[i], front[j], back[j]]))
    return np.concatenate(parts)


def _panel(face: _Quad, inset: Sequence[float], lift: float = 0.0012) -> _Triangles:
    """A pane laid on a four-cornered face.

    Args:
        face: Corners, counter-clockwise from outside, starting at the pane's lower left.
        inset: Shares of the face left free at its left, right, bottom and top.
        lift: How far the pane stands off the face.
    """
    left, right, bottom, top = inset
    a, b, c, d = face
    normal = np.cross(b - a, d - a)
    normal = normal / np.linalg.norm(normal)

    def at(u: float, v: float) -> Float[np.ndarray, " 3"]:
        point: Float[np.ndarray, " 3"] = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * c)
        return point + lift * normal

    return _quad(
        np.array([at(left, bottom), at(1 - right, bottom), at(1 - right, 1 - top), at(left, 1 - top)])
    )


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> _Triangles:
    half = (x[1] - x[0]) / 2
    box = _loft([(y[0], half, half, *z), (y[1], half, half, *z)])
    return box + np.array([x[0] + half, 0.0, 0.0])


def _disc(x: float, centre: tuple[float, float], radius: float, n_sides: int) -> _Triangles:
    """A polygon at `x` that faces +x."""
    angles = np.linspace(0, 2 * np.pi, n_sides, endpoint=False)
    rim = np.stack(
        [np.full(n_sides, x), centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)],
        axis=1,
    )
    middle = np.broadcast_to([x, *centre], rim.shape)
    return np.stack([middle, rim, np.roll(rim, -1, axis=0)], axis=1)


def _wheel(x_inner: float, x_outer: float, y: float, radius: float) -> _Triangles:
    """A tyre on the car's right side: the outer face and the tread."""
    outer = _disc(x_outer, (y, radius), radius, 10)
    rim = outer[:, 1]
    inner = rim * (0.0, 1.0, 1.0) + (x_inner, 0.0, 0.0)
    tread = [
        _quad([inner[i], inner[i - 9], rim[i - 9], rim[i]])  # i - 9 is i + 1 modulo 10
        for i in range(10)
    ]
    return np.concatenate([outer, *tread])


def _wheels(axles: Sequence[float], x_outer: float, radius: float) -> tuple[Mesh, Mesh]:
    tyres = [_both_sides(_wheel(x_outer - 0.02, x_outer, y, radius)) for y in axles]
    hubs = [_both_sides(_disc(x_outer + 0.001, (y, radius), 0.55 * radius, 6)) for y in axles]
    return _mesh(tyres, _TYRE), _mesh(hubs, _HUB)


def _shadow(half_width: float, half_length: float) -> Mesh:
    """A soft-cornered patch on the ground that ties the car to it."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)

    def rounded(wave: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return np.sign(wave) * np.abs(wave) ** 0.5

    rim = np.stack(
        [
            half_width * rounded(np.cos(angles)),
            half_length * rounded(np.sin(angles)),
            np.full(16, 4 * _LAYER),
        ],
        axis=1,
    )
    middle = np.broadcast_to([0.0, 0.0, 4 * _LAYER], rim.shape)
    return _mesh([np.stack([middle, rim, np.roll(rim, -1, axis=0)], axis=1)], _SHADOW)


def _cabin_faces(
    bottom: tuple[float, float, float, float], top: tuple[float, float, float, float]
) -> dict[str, _Quad]:
    """Faces of a frustum between `(y_back, y_front, half width, z)` below and above, named."""
    (y0, y1, w, z), (ty0, ty1, tw, tz) = bottom, top
    return {
        "front": np.array([(w, y1, z), (-w, y1, z), (-tw, ty1, tz), (tw, ty1, tz)]),
        "back": np.array([(-w, y0, z), (w, y0, z), (tw, ty0, tz), (-tw, ty0, tz)]),
        "right": np.array([(w, y0, z), (w, y1, z), (tw, ty1, tz), (tw, ty0, tz)]),
        "roof": np.array([(-tw, ty0, tz), (tw, ty0, tz), (tw, ty1, tz), (-tw, ty1, tz)]),
    }


def _cabin_shell(faces: dict[str, _Quad]) -> list[_Triangles]:
    return [
        _quad(faces["front"]),
        _quad(faces["back"]),
        _quad(faces["roof"]),
        _both_sides(_quad(faces["right"])),
    ]


def _robot_car() -> Body:
    """A low sedan: long bonnet, sloping screens, short boot."""
    hull = _loft(
        [
            (-0.120, 0.044, 0.042, 0.022, 0.044),
            (-0.112, 0.053, 0.049, 0.015, 0.055),
            (-0.060, 0.055, 0.051, 0.015, 0.058),
            (0.035, 0.055, 0.051, 0.015, 0.057),
            (0.098, 0.053, 0.047, 0.015, 0.047),
            (0.120, 0.043, 0.040, 0.022, 0.037),
        ]
    )
    faces = _cabin_faces((-0.088, 0.046, 0.049, 0.0565), (-0.054, 0.008, 0.038, 0.086))
    headlight = _quad(
        [(0.018, 0.1215, 0.0405), (0.018, 0.1, 0.050), (0.047, 0.1, 0.050), (0.042, 0.1215, 0.0405)]
    )
    front_light = _quad(
        [(0.042, 0.1215, 0.026), (0.018, 0.1215, 0.026), (0.018, 0.1215, 0.0405), (0.042, 0.1215, 0.0405)]
    )
    tail = _quad(
        [(0.015, -0.1225, 0.030), (0.043, -0.1225, 0.030), (0.043, -0.1225, 0.047), (0.015, -0.1225, 0.047)]
    )
    tail_top = _quad(
        [(0.015, -0.1225, 0.047), (0.043, -0.1225, 0.047), (0.050, -0.109, 0.061), (0.015, -0.109, 0.061)]
    )
    tyres, hubs = _wheels((-0.072, 0.072), 0.0565, 0.0215)
    return Body(
        "robot_car",
        (
            _shadow(0.066, 0.132),
            tyres,
            hubs,
            _mesh([hull, *_cabin_shell(faces)], _BLUE),
            _mesh([_panel(faces["front"], (0.04, 0.04, 0.02, 0.04))], _WINDSCREEN),
            _mesh(
                [
                    _panel(faces["back"], (0.06, 0.06, 0.1, 0.06)),
                    _both_sides(_panel(faces["right"], (0.06, 0.52, 0.12, 0.12))),
                    _both_sides(_panel(faces["right"], (0.53, 0.06, 0.12, 0.12))),
                ],
                _GLASS,
            ),
            _mesh([_both_sides(headlight), _both_sides(front_light)], _HEADLIGHT),
            _mesh([_both_sides(tail), _both_sides(tail_top)], _TAIL_LIGHT),
        ),
    )


def _human_car() -> Body:
    """A tall, boxy van: hardly any bonnet, upright back, roof rails."""
    hull = _loft(
        [
            (-0.120, 0.051, 0.051, 0.020, 0.064),
            (-0.114, 0.055, 0.054, 0.016, 0.066),
            (0.070, 0.055, 0.054, 0.016, 0.064),
            (0.108, 0.053, 0.050, 0.016, 0.057),
            (0.120, 0.049, 0.047, 0.022, 0.048),
        ]
    )
    faces = _cabin_faces((-0.118, 0.074, 0.053, 0.063), (-0.112, 0.040, 0.047, 0.112))
    headlight = _quad(
        [(0.048, 0.1215, 0.030), (0.024, 0.1215, 0.030), (0.024, 0.1215, 0.048), (0.047, 0.1215, 0.048)]
    )
    light_top = _quad(
        [(0.047, 0.1215, 0.048), (0.024, 0.1215, 0.048), (0.024, 0.107, 0.0585), (0.050, 0.107, 0.0585)]
    )
    tail = _quad(
        [(0.040, -0.1215, 0.036), (0.051, -0.1215, 0.036), (0.050, -0.1195, 0.082), (0.040, -0.1195, 0.082)]
    )
    bumper = [
        _quad(
            [
                (-0.050, -0.1215, 0.020),
                (0.050, -0.1215, 0.020),
                (0.050, -0.1215, 0.033),
                (-0.050, -0.1215, 0.033),
            ]
        ),
        _quad(
            [(0.022, 0.1212, 0.024), (-0.022, 0.1212, 0.024), (-0.022, 0.1212, 0.046), (0.022, 0.1212, 0.046)]
        ),
    ]
    rails = _both_sides(_box((0.034, 0.039), (-0.104, 0.030), (0.112, 0.1175)))
    bars = [_box((-0.039, 0.039), (y, y + 0.007), (0.114, 0.119)) for y in (-0.085, -0.035, 0.015)]
    tyres, hubs = _wheels((-0.074, 0.074), 0.0570, 0.0235)
    return Body(
        "human_car",
        (
            _shadow(0.068, 0.134),
            tyres,
            hubs,
            _mesh([hull, *_cabin_shell(faces)], _VERMILION),
            _mesh([_panel(faces["front"], (0.05, 0.05, 0.04, 0.05))], _WINDSCREEN),
            _mesh(
                [
                    _panel(faces["back"], (0.08, 0.08, 0.34, 0.1)),
                    _both_sides(_panel(faces["right"], (0.05, 0.66, 0.16, 0.16))),
                    _both_sides(_panel(faces["right"], (0.38, 0.36, 0.16, 0.16))),
                    _both_sides(_panel(faces["right"], (0.68, 0.04, 0.16, 0.16))),
                ],
                _GLASS,
            ),
            _mesh([_both_sides(headlight), _both_sides(light_top)], _HEADLIGHT),
            _mesh([_both_sides(tail)], _TAIL_LIGHT),
            _mesh([*bumper, rails, *bars], _TRIM),
        ),
    )


ROBOT_CAR: Body = _robot_car()
"""The car whose drive is judged: a blue sedan."""

HUMAN_CAR: Body = _human_car()
"""The car it meets: a vermilion van."""


def _strip(x: tuple[float, float], y: tuple[float, float], layer: int) -> _Triangles:
    """A flat rectangle that faces up, on the given layer of the ground."""
    z = layer * _LAYER
    return _quad([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)])


def _dashes(y: tuple[float, float]) -> list[_Triangles]:
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
    return np.stack([x, start + rng.uniform(0.0, _CELL, n), np.full(n, _LAYER)], axis=1)


def _tufts(y: tuple[float, float], seed: int) -> _Triangles:
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


def _turned(shape: Float[np.ndarray, "k 3"], angles: Float[np.ndarray, " n"]) -> _Triangles:
    """A flat shape at each of several angles."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y, z = shape.T
    return np.stack([c * x - s * y, s * x + c * y, z + 0 * c], axis=2)


def _patches(y: tuple[float, float], seed: int, height: float) -> _Triangles:
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
        _mesh([_patches(y, 3, 0.2 * _LAYER)], _MEADOW_LIGHT),
        _mesh([_patches(y, 4, 0.6 * _LAYER)], _MEADOW_DARK),
        _mesh([_tufts(y, 5)], _GRASS_LIGHT),
        _mesh([_tufts(y, 6)], _GRASS_DARK),
        _mesh([_strip((-kerb, kerb), y, 1)], _KERB),
        _mesh([_strip((-edge, edge), y, 2)], _ASPHALT),
        _mesh([*lines, *_dashes(y)], _LINE),
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
