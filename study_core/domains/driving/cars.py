"""The two cars. Pure data; nothing here knows how it is drawn.

Lengths are in the driving model's units (a car is about 0.11 by 0.24). The two differ in silhouette as well as in
colour, and the colours are Okabe and Ito's blue and vermilion, which people of every type of colour vision tell apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from study_core.domains.driving.shapes import LAYER, Quad, Triangles, mesh_of, quad
from study_core.scene import Body, Mesh

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


def _mirrored(triangles: Triangles) -> Triangles:
    """The same triangles on the car's other side, still facing outwards."""
    return (triangles * (-1.0, 1.0, 1.0))[:, ::-1]


def _both_sides(triangles: Triangles) -> Triangles:
    return np.concatenate([triangles, _mirrored(triangles)])


def _corners(ring: _Ring) -> Quad:
    """Corners of a cross-section: bottom right, top right, top left, bottom left (seen from behind)."""
    y, bottom, top, z_bottom, z_top = ring
    return np.array([(bottom, y, z_bottom), (top, y, z_top), (-top, y, z_top), (-bottom, y, z_bottom)])


def _loft(rings: Sequence[_Ring]) -> Triangles:
    """A closed hull through cross-sections that are given from the back to the front."""
    sections = [_corners(ring) for ring in rings]
    parts = [quad(sections[0]), quad(sections[-1][::-1])]
    for back, front in pairwise(sections):
        for i in range(4):
            j = (i + 1) % 4
            parts.append(quad([back[i], front[i], front[j], back[j]]))
    return np.concatenate(parts)


def _panel(face: Quad, inset: Sequence[float], lift: float = 0.0012) -> Triangles:
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

    return quad(
        np.array([at(left, bottom), at(1 - right, bottom), at(1 - right, 1 - top), at(left, 1 - top)])
    )


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Triangles:
    half = (x[1] - x[0]) / 2
    box = _loft([(y[0], half, half, *z), (y[1], half, half, *z)])
    return box + np.array([x[0] + half, 0.0, 0.0])


def _disc(x: float, centre: tuple[float, float], radius: float, n_sides: int) -> Triangles:
    """A polygon at `x` that faces +x."""
    angles = np.linspace(0, 2 * np.pi, n_sides, endpoint=False)
    rim = np.stack(
        [np.full(n_sides, x), centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)],
        axis=1,
    )
    middle = np.broadcast_to([x, *centre], rim.shape)
    return np.stack([middle, rim, np.roll(rim, -1, axis=0)], axis=1)


def _wheel(x_inner: float, x_outer: float, y: float, radius: float) -> Triangles:
    """A tyre on the car's right side: the outer face and the tread."""
    outer = _disc(x_outer, (y, radius), radius, 10)
    rim = outer[:, 1]
    inner = rim * (0.0, 1.0, 1.0) + (x_inner, 0.0, 0.0)
    tread = [
        quad([inner[i], inner[i - 9], rim[i - 9], rim[i]])  # i - 9 is i + 1 modulo 10
        for i in range(10)
    ]
    return np.concatenate([outer, *tread])


def _wheels(axles: Sequence[float], x_outer: float, radius: float) -> tuple[Mesh, Mesh]:
    tyres = [_both_sides(_wheel(x_outer - 0.02, x_outer, y, radius)) for y in axles]
    hubs = [_both_sides(_disc(x_outer + 0.001, (y, radius), 0.55 * radius, 6)) for y in axles]
    return mesh_of(tyres, _TYRE), mesh_of(hubs, _HUB)


def _shadow(half_width: float, half_length: float) -> Mesh:
    """A soft-cornered patch on the ground that ties the car to it."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)

    def rounded(wave: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return np.sign(wave) * np.abs(wave) ** 0.5

    rim = np.stack(
        [
            half_width * rounded(np.cos(angles)),
            half_length * rounded(np.sin(angles)),
            np.full(16, 4 * LAYER),
        ],
        axis=1,
    )
    middle = np.broadcast_to([0.0, 0.0, 4 * LAYER], rim.shape)
    return mesh_of([np.stack([middle, rim, np.roll(rim, -1, axis=0)], axis=1)], _SHADOW)


def _cabin_faces(
    bottom: tuple[float, float, float, float], top: tuple[float, float, float, float]
) -> dict[str, Quad]:
    """Faces of a frustum between `(y_back, y_front, half width, z)` below and above, named."""
    (y0, y1, w, z), (ty0, ty1, tw, tz) = bottom, top
    return {
        "front": np.array([(w, y1, z), (-w, y1, z), (-tw, ty1, tz), (tw, ty1, tz)]),
        "back": np.array([(-w, y0, z), (w, y0, z), (tw, ty0, tz), (-tw, ty0, tz)]),
        "right": np.array([(w, y0, z), (w, y1, z), (tw, ty1, tz), (tw, ty0, tz)]),
        "roof": np.array([(-tw, ty0, tz), (tw, ty0, tz), (tw, ty1, tz), (-tw, ty1, tz)]),
    }


def _cabin_shell(faces: dict[str, Quad]) -> list[Triangles]:
    return [
        quad(faces["front"]),
        quad(faces["back"]),
        quad(faces["roof"]),
        _both_sides(quad(faces["right"])),
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
    headlight = quad(
        [(0.018, 0.1215, 0.0405), (0.018, 0.1, 0.050), (0.047, 0.1, 0.050), (0.042, 0.1215, 0.0405)]
    )
    front_light = quad(
        [(0.042, 0.1215, 0.026), (0.018, 0.1215, 0.026), (0.018, 0.1215, 0.0405), (0.042, 0.1215, 0.0405)]
    )
    tail = quad(
        [(0.015, -0.1225, 0.030), (0.043, -0.1225, 0.030), (0.043, -0.1225, 0.047), (0.015, -0.1225, 0.047)]
    )
    tail_top = quad(
        [(0.015, -0.1225, 0.047), (0.043, -0.1225, 0.047), (0.050, -0.109, 0.061), (0.015, -0.109, 0.061)]
    )
    tyres, hubs = _wheels((-0.072, 0.072), 0.0565, 0.0215)
    return Body(
        "robot_car",
        (
            _shadow(0.066, 0.132),
            tyres,
            hubs,
            mesh_of([hull, *_cabin_shell(faces)], _BLUE),
            mesh_of([_panel(faces["front"], (0.04, 0.04, 0.02, 0.04))], _WINDSCREEN),
            mesh_of(
                [
                    _panel(faces["back"], (0.06, 0.06, 0.1, 0.06)),
                    _both_sides(_panel(faces["right"], (0.06, 0.52, 0.12, 0.12))),
                    _both_sides(_panel(faces["right"], (0.53, 0.06, 0.12, 0.12))),
                ],
                _GLASS,
            ),
            mesh_of([_both_sides(headlight), _both_sides(front_light)], _HEADLIGHT),
            mesh_of([_both_sides(tail), _both_sides(tail_top)], _TAIL_LIGHT),
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
    headlight = quad(
        [(0.048, 0.1215, 0.030), (0.024, 0.1215, 0.030), (0.024, 0.1215, 0.048), (0.047, 0.1215, 0.048)]
    )
    light_top = quad(
        [(0.047, 0.1215, 0.048), (0.024, 0.1215, 0.048), (0.024, 0.107, 0.0585), (0.050, 0.107, 0.0585)]
    )
    tail = quad(
        [(0.040, -0.1215, 0.036), (0.051, -0.1215, 0.036), (0.050, -0.1195, 0.082), (0.040, -0.1195, 0.082)]
    )
    bumper = [
        quad(
            [
                (-0.050, -0.1215, 0.020),
                (0.050, -0.1215, 0.020),
                (0.050, -0.1215, 0.033),
                (-0.050, -0.1215, 0.033),
            ]
        ),
        quad(
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
            mesh_of([hull, *_cabin_shell(faces)], _VERMILION),
            mesh_of([_panel(faces["front"], (0.05, 0.05, 0.04, 0.05))], _WINDSCREEN),
            mesh_of(
                [
                    _panel(faces["back"], (0.08, 0.08, 0.34, 0.1)),
                    _both_sides(_panel(faces["right"], (0.05, 0.66, 0.16, 0.16))),
                    _both_sides(_panel(faces["right"], (0.38, 0.36, 0.16, 0.16))),
                    _both_sides(_panel(faces["right"], (0.68, 0.04, 0.16, 0.16))),
                ],
                _GLASS,
            ),
            mesh_of([_both_sides(headlight), _both_sides(light_top)], _HEADLIGHT),
            mesh_of([_both_sides(tail)], _TAIL_LIGHT),
            mesh_of([*bumper, rails, *bars], _TRIM),
        ),
    )


ROBOT_CAR: Body = _robot_car()
"""The car whose drive is judged: a blue sedan."""

HUMAN_CAR: Body = _human_car()
"""The car it meets: a vermilion van."""
