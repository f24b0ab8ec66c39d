"""Turns two scenes into one animated clip: a binary glTF that plays by itself in the browser. Pure.

Everything in a clip, the two sides' cars as well, runs on one clock and loops together:
first pose held for `LEAD_S`, the drive, last pose held for `TAIL_S`, and again.

A clip says itself what it is, by two small squares in one of eight colours in the middle of the picture, where
the page draws the gutter between the sides over them. The *mark* tells which picture it is, the *flag* which clip
of it: the browser draws them in the very frame in which it draws the cars, so a page that looks at those two
pixels knows the first frame of everything that comes on the screen (see `app.stage.stage`, `static/js/stage.js`).

Everything in a clip lies within `LEVEL_Z` of the ground, which lies alike in every clip: so a clip that is this
much nearer to the viewer hides another one wholly.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float

from app.stage import paint
from app.stage.framing import Framing, Layout, Placement, frame, ground_height, half_centres, half_extents
from app.stage.gltf import GlbWriter, Packed
from study_core.scene import Body, Mesh, Scene, Track

LEAD_S = 0.6
TAIL_S = 0.8
N_MARKS = 8
"""How many pictures in a row a page can tell apart."""
N_FLAGS = 8
"""How many clips in a row a page can tell apart."""
LEVEL_Z = 0.4
"""How much nearer to the viewer a clip must lie to hide another: more than bodies are tall in any picture, and so
little that from the camera's distance nothing looks larger by a thousandth."""
# A looping clip that starts in its middle jumps from the last pose to the first within this time.
_JUMP_S = 0.001
# Under the lowest of the ground's own layers.
_BACKDROP_DEPTH = 0.01
_BACKDROP_REACH = 3.0
# The page's gutter is wider than the mark on every screen; the mark covers whole pixels on the smallest.
_MARK_REACH = 0.012
_MARK_HEIGHT = 8.0
# From the middle along the gutter, in units of half the picture's height; the page looks there.
_FLAG_SHIFT = 0.06

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class _Primitive:
    """Encoded triangles of one material: vertex colours if opaque, one colour if translucent."""

    positions: Packed
    light: Packed | None
    colour: str


class _Remembered:
    """Encoded meshes by the identity of what they encode, least recently used dropped first.

    Meshes hold arrays and so have no usable hash; an entry keeps its key's objects alive, so that an identity
    can't come to mean something else.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._entries: OrderedDict[tuple[object, ...], tuple[object, Any]] = OrderedDict()

    def get(self, subject: object, detail: tuple[object, ...], make: Callable[[], _Value]) -> _Value:
        key = (id(subject), *detail)
        found = self._entries.pop(key, None)
        if found is None:
            found = (subject, make())
        self._entries[key] = found
        while len(self._entries) > self._capacity:
            # Another thread may have dropped the last one; clips are small and both results are equal.
            self._entries.popitem(last=False)
        value: _Value = found[1]
        return value


_encoded = _Remembered(capacity=256)


def duration_s(a: Scene, b: Scene) -> float:
    """Length of one loop of the clip of two scenes, holds included, in seconds."""
    return LEAD_S + max(_drive_s(a), _drive_s(b)) + TAIL_S


def mark_colour(number: int) -> str:
    """The colour of a mark or flag: one bit of its number modulo `N_MARKS`, in each of red, green, blue."""
    return "#" + "".join("d0" if number >> bit & 1 else "30" for bit in range(3))


def build_clip(
    a: Scene,
    b: Scene,
    layout: Layout,
    start_s: float = 0.0,
    frozen: bool = False,
    speed: float = 1.0,
    mark: int = 0,
    flag: int = 0,
) -> bytes:
    """Builds the clip of two scenes.

    Args:
        a: Upper (wide) or left (tall) side.
        b: The other side.
        layout: Arrangement of the sides.
        start_s: Where in the loop the clip begins; it wraps around.
        frozen: Whether it stays at that point instead of playing.
        speed: Seconds of the loop per second.
        mark: The picture's number, for its mark.
        flag: The clip's number, for its flag: tells it from others of the same picture.

    Returns:
        A GLB file; equal arguments give equal bytes.
    """
    writer = GlbWriter()
    framing = frame(a.bounds.union(b.bounds), layout)
    end_s = duration_s(a, b)
    ink = _Ink(writer)
    channels: list[tuple[int, Track, float]] = []
    for scene, placement, centre in zip((a, b), (framing.a, framing.b), half_centres(layout), strict=True):
        _add_backdrop(ink, scene.background, centre, layout)
        children, moving = _add_side(ink, scene, framing)
        channels += [(node, track, scene.dt_s) for node, track in moving]
        _add_root(writer, placement, children)
    _add_marks(ink, layout, mark, flag)
    _add_motion(writer, channels, end_s, start_s % end_s, None if frozen else speed)
    return writer.finish()


class _Ink:
    """Meshes and materials already in the file, so that both sides share them."""

    def __init__(self, writer: GlbWriter) -> None:
        self.writer = writer
        self._meshes: dict[int, int] = {}
        self._materials: dict[str, int] = {}

    def material(self, colour: str) -> int:
        """Index of the material for a colour; the empty colour means vertex colours."""
        if colour not in self._materials:
            light = paint.flat(colour) if colour else (1.0, 1.0, 1.0)
            alpha = paint.alpha_of(colour) if colour else 1.0
            self._materials[colour] = self.writer.unlit(*light, alpha)
        return self._materials[colour]

    def mesh(self, primitives: tuple[_Primitive, ...]) -> int:
        """Index of the mesh made of encoded primitives."""
        key = id(primitives)
        if key not in self._meshes:
            entry = {"primitives": [self._primitive(primitive) for primitive in primitives]}
            self._meshes[key] = self.writer.add("meshes", entry)
        return self._meshes[key]

    def _primitive(self, primitive: _Primitive) -> dict[str, Any]:
        attributes = {"POSITION": self.writer.accessor(primitive.positions)}
        if primitive.light is not None:
            attributes["COLOR_0"] = self.writer.accessor(primitive.light)
        return {"attributes": attributes, "material": self.material(primitive.colour)}


def _drive_s(scene: Scene) -> float:
    return scene.dt_s * max((len(track.positions) - 1 for track in scene.tracks), default=0)


def _corners(mesh: Mesh) -> Float[np.ndarray, "n 3 3"]:
    return mesh.vertices[mesh.triangles]


def _encode(parts: Sequence[tuple[Mesh, Float[np.ndarray, "n 3 3"]]]) -> tuple[_Primitive, ...]:
    """Encodes meshes: all opaque ones become one primitive, each translucent one its own."""
    opaque = [
        (mesh, corners) for mesh, corners in parts if paint.alpha_of(mesh.colour) == 1.0 and len(corners)
    ]
    primitives = []
    if opaque:
        positions = np.concatenate([corners for _, corners in opaque]).reshape(-1, 3)
        light = np.concatenate([paint.shaded(mesh, corners) for mesh, corners in opaque]).repeat(3, axis=0)
        primitives.append(_Primitive(Packed(positions, bounded=True), Packed(light), ""))
    for mesh, corners in parts:
        if paint.alpha_of(mesh.colour) < 1.0 and len(corners):
            primitives.append(_Primitive(Packed(corners.reshape(-1, 3), bounded=True), None, mesh.colour))
    return tuple(primitives)


def _encode_body(body: Body) -> tuple[_Primitive, ...]:
    return _encode([(mesh, _corners(mesh)) for mesh in body.meshes])


def _encode_ground(ground: Sequence[Mesh], framing: Framing) -> tuple[_Primitive, ...]:
    return _encode([(mesh, _visible(_corners(mesh), framing)) for mesh in ground])


def _visible(corners: Float[np.ndarray, "n 3 3"], framing: Framing) -> Float[np.ndarray, "m 3 3"]:
    """Cuts triangles off at the edges of a half, so that no side's ground reaches into the other."""
    centre = half_centres(framing.layout)[0]
    reach = half_extents(framing.layout)
    across = 1 if framing.layout is Layout.WIDE else 0
    for axis, limit in ((across, reach[across]), (1 - across, 1.05 * reach[1 - across])):
        for sign in (-1.0, 1.0):
            placed = framing.a.apply(corners.reshape(-1, 3)).reshape(-1, 3, 3) - centre
            corners = _cut(corners, limit - sign * placed[:, :, axis])
    return corners


def _cut(corners: Float[np.ndarray, "n 3 3"], room: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Keeps the part of each triangle where there is room.

    Args:
        corners: Triangles.
        room: How far each corner is from the edge, negative beyond it; linear on a triangle.
    """
    is_inside = room >= 0
    n_inside = is_inside.sum(axis=1)
    is_cut = (n_inside % 3) > 0
    polygons, is_there = _polygons(corners[is_cut], room[is_cut], is_inside[is_cut])
    is_triangle = n_inside[is_cut] == 1
    triangles = polygons[is_triangle][is_there[is_triangle]].reshape(-1, 3, 3)
    quads = polygons[~is_triangle][is_there[~is_triangle]].reshape(-1, 4, 3)
    pieces = np.concatenate([triangles, quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    # In the order of the triangles that they come from.
    origin = np.concatenate([np.flatnonzero(is_triangle), *[np.flatnonzero(~is_triangle)] * 2])
    return np.concatenate([corners[n_inside == 3], pieces[np.argsort(origin, kind="stable")]])


def _polygons(
    corners: Float[np.ndarray, "n 3 3"], room: Float[np.ndarray, "n 3"], is_inside: Bool[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 6 3"], Bool[np.ndarray, "n 6"]]:
    """Returns each triangle's corners and where its sides are cut, in turn, and which of these bound what is left."""
    following, room_there = np.roll(corners, -1, axis=1), np.roll(room, -1, axis=1)
    is_crossed = is_inside != np.roll(is_inside, -1, axis=1)
    drop = np.where(is_crossed, room - room_there, 1.0)[..., None]
    cuts = corners + (following - corners) * room[..., None] / drop
    polygons = np.stack([corners, cuts], axis=2).reshape(-1, 6, 3)
    return polygons, np.stack([is_inside, is_crossed], axis=2).reshape(-1, 6)


def _add_backdrop(ink: _Ink, colour: str, centre: Float[np.ndarray, " 3"], layout: Layout) -> None:
    """Fills one half of the picture, and what lies beyond its outer edges, with a colour."""
    wide = layout is Layout.WIDE
    reach = half_extents(layout) * (_BACKDROP_REACH, _BACKDROP_REACH)
    # The inner edge is the picture's middle line; the outer edges reach well past the picture.
    inner_axis = 1 if wide else 0
    outwards = float(np.sign(centre[inner_axis]))
    low, high = -reach, reach.copy()
    low[inner_axis], high[inner_axis] = sorted((0.0, outwards * reach[inner_axis]))
    heights = [ground_height(float(y - centre[1]), layout) - _BACKDROP_DEPTH for y in (low[1], high[1])]
    _add_rectangle(ink, colour, low, high, *heights)


def _add_marks(ink: _Ink, layout: Layout, mark: int, flag: int) -> None:
    """Puts the mark into the middle of the picture and the flag beside it, in front of everything."""
    reach = np.full(2, _MARK_REACH)
    shift = np.array([_FLAG_SHIFT, 0.0]) if layout is Layout.WIDE else np.array([0.0, _FLAG_SHIFT])
    for middle, number in ((np.zeros(2), mark), (shift, flag)):
        _add_rectangle(ink, mark_colour(number), middle - reach, middle + reach, _MARK_HEIGHT, _MARK_HEIGHT)


def _add_rectangle(
    ink: _Ink, colour: str, low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"], z0: float, z1: float
) -> None:
    """Adds a rectangle in picture coordinates; `z0` and `z1` are how near its lower and upper edges are."""
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    quad = np.array([(x0, y0, z0), (x1, y0, z0), (x1, y1, z1), (x0, y0, z0), (x1, y1, z1), (x0, y1, z1)])
    attributes = {"POSITION": ink.writer.accessor(Packed(quad, bounded=True))}
    primitive = {"attributes": attributes, "material": ink.material(colour)}
    mesh = ink.writer.add("meshes", {"primitives": [primitive]})
    ink.writer.document["scenes"][0]["nodes"].append(ink.writer.add("nodes", {"mesh": mesh}))


def _add_side(ink: _Ink, scene: Scene, framing: Framing) -> tuple[list[int], list[tuple[int, Track]]]:
    """Adds one side's ground and bodies; returns their nodes and those that move."""
    writer = ink.writer
    nodes = []
    ground = _encoded.get(
        scene.ground,
        (framing.layout, round(framing.a.scale, 9), *np.round(framing.a.offset, 9).tolist()),
        lambda: _encode_ground(scene.ground, framing),
    )
    if ground:
        nodes.append(writer.add("nodes", {"name": "ground", "mesh": ink.mesh(ground)}))
    moving = []
    for track in scene.tracks:
        body = track.body
        primitives = _encoded.get(body, (), lambda body=body: _encode_body(body))  # type: ignore[misc]
        node = writer.add("nodes", {"name": body.name, "mesh": ink.mesh(primitives)})
        moving.append((node, track))
        nodes.append(node)
    return nodes, moving


def _add_root(writer: GlbWriter, placement: Placement, children: list[int]) -> None:
    """Adds the node that carries one side to its place in the picture."""
    node = {
        "children": children,
        "translation": placement.offset.tolist(),
        "rotation": _quaternion(placement.rotation),
        "scale": [placement.scale] * 3,
    }
    writer.document["scenes"][0]["nodes"].append(writer.add("nodes", node))


def _quaternion(rotation: Float[np.ndarray, "3 3"]) -> list[float]:
    """Quaternion `(x, y, z, w)` of a rotation whose angle is less than 180 degrees."""
    w = np.sqrt(1.0 + np.trace(rotation)) / 2
    x, y, z = (
        (rotation[2, 1] - rotation[1, 2]) / (4 * w),
        (rotation[0, 2] - rotation[2, 0]) / (4 * w),
        (rotation[1, 0] - rotation[0, 1]) / (4 * w),
    )
    return [float(x), float(y), float(z), float(w)]


def _keys(
    track: Track, dt_s: float, end_s: float
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 4"]]:
    """Key times and poses `(x, y, z, yaw)` of one loop that starts at its beginning."""
    poses = np.column_stack([track.positions, np.unwrap(track.yaws_rad)])
    times = LEAD_S + dt_s * np.arange(len(poses))
    return (
        np.concatenate([[0.0], times, [end_s]]),
        np.concatenate([poses[:1], poses, poses[-1:]]),
    )


def _pose_at(
    times: Float[np.ndarray, " n"], poses: Float[np.ndarray, "n 4"], at_s: float
) -> Float[np.ndarray, "1 4"]:
    return np.array([[np.interp(at_s, times, column) for column in poses.T]])


def _from(
    times: Float[np.ndarray, " n"], poses: Float[np.ndarray, "n 4"], start_s: float
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m 4"]]:
    """The same loop, begun at `start_s`."""
    if start_s == 0.0:
        return times, poses
    late, early = times > start_s, times < start_s
    end_s = times[-1]
    wrapped = times[early] + end_s - start_s
    wrapped[0] += _JUMP_S
    here = _pose_at(times, poses, start_s)
    return (
        np.concatenate([[0.0], times[late] - start_s, wrapped, [end_s + _JUMP_S]]),
        np.concatenate([here, poses[late], poses[early], here]),
    )


def _turns(yaws_rad: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4"]:
    """Quaternions `(x, y, z, w)` of turns about z; continuous because the angles are."""
    nothing = np.zeros_like(yaws_rad)
    return np.stack([nothing, nothing, np.sin(yaws_rad / 2), np.cos(yaws_rad / 2)], axis=1)


def _add_motion(
    writer: GlbWriter,
    channels: list[tuple[int, Track, float]],
    end_s: float,
    start_s: float,
    speed: float | None,
) -> None:
    """Gives every body its pose at the start, and its motion unless there is no speed."""
    animation: dict[str, Any] = {"channels": [], "samplers": []}
    clocks: dict[tuple[int, float], int] = {}
    for node, track, dt_s in channels:
        times, poses = _keys(track, dt_s, end_s)
        pose = _pose_at(times, poses, start_s)
        entry = writer.document["nodes"][node]
        entry["translation"] = pose[0, :3].tolist()
        entry["rotation"] = _turns(pose[:, 3])[0].tolist()
        if speed is None:
            continue
        times, poses = _from(times, poses, start_s)
        rhythm = (len(track.positions), dt_s)
        if rhythm not in clocks:
            clocks[rhythm] = writer.accessor(Packed(times / speed, bounded=True))
        for path, values in (("translation", poses[:, :3]), ("rotation", _turns(poses[:, 3]))):
            sampler = {
                "input": clocks[rhythm],
                "output": writer.accessor(Packed(values)),
                "interpolation": "LINEAR",
            }
            animation["samplers"].append(sampler)
            target = {"node": node, "path": path}
            animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})
    if animation["channels"]:
        writer.document["animations"] = [animation]
