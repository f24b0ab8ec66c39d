"""A clip is read back by an independent reader of glTF and compared with the scenes."""

from __future__ import annotations

import json
import struct
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from app.stage.clip import (
    LEAD_S,
    LEVEL_Z,
    N_FLAGS,
    N_MARKS,
    TAIL_S,
    build_clip,
    duration_s,
    mark_colour,
)
from app.stage.framing import CAMERA, Layout, frame, half_centres, half_extents
from study_core.scene import Scene
from tests.stage.made_up import DT_S, N_FRAMES, drive


@dataclass(frozen=True)
class Glb:
    document: dict[str, Any]
    binary: bytes

    def array(self, index: int) -> np.ndarray:
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        assert accessor["componentType"] == 5126
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert view["byteLength"] == accessor["count"] * width * 4
        values = np.frombuffer(self.binary, "<f4", accessor["count"] * width, view["byteOffset"])
        array: np.ndarray = values.reshape(accessor["count"], width)
        return array

    def moving(self) -> list[int]:
        """Nodes of A's robot and human, then B's."""
        return [i for i, node in enumerate(self.document["nodes"]) if node.get("name", "").endswith("_car")]

    def curve(self, node: int, path: str) -> tuple[np.ndarray, np.ndarray]:
        [animation] = self.document["animations"]
        [channel] = [c for c in animation["channels"] if c["target"] == {"node": node, "path": path}]
        sampler = animation["samplers"][channel["sampler"]]
        assert sampler["interpolation"] == "LINEAR"
        return self.array(sampler["input"])[:, 0], self.array(sampler["output"])


def read(data: bytes) -> Glb:
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    json_length, json_kind = struct.unpack_from("<I4s", data, 12)
    assert json_kind == b"JSON"
    document = json.loads(data[20 : 20 + json_length])
    binary_length, binary_kind = struct.unpack_from("<I4s", data, 20 + json_length)
    assert binary_kind == b"BIN\0"
    binary = data[28 + json_length :]
    assert len(binary) == binary_length == document["buffers"][0]["byteLength"]
    assert json_length % 4 == binary_length % 4 == 0
    return Glb(document, binary)


def yaw_of(quaternion: np.ndarray) -> np.ndarray:
    """Turn about z of quaternions `(x, y, z, w)` that only turn about z."""
    assert np.abs(quaternion[..., :2]).max() == 0
    yaws: np.ndarray = 2 * np.arctan2(quaternion[..., 2], quaternion[..., 3])
    return yaws


def expected(scene: Scene, i: int, at_s: float) -> np.ndarray:
    """Pose `(x, y, z, yaw)` of a body at a time of the drive."""
    track = scene.tracks[i]
    times = DT_S * np.arange(N_FRAMES)
    return np.array([np.interp(at_s, times, c) for c in (*track.positions.T, track.yaws_rad)])


@pytest.mark.parametrize("layout", Layout)
def test_the_animation_reproduces_positions_and_headings(scenes: tuple[Scene, Scene], layout: Layout) -> None:
    glb = read(build_clip(*scenes, layout))
    for node, (scene, i) in zip(glb.moving(), [(s, i) for s in scenes for i in (0, 1)], strict=True):
        track = scene.tracks[i]
        times, positions = glb.curve(node, "translation")
        np.testing.assert_allclose(times[1:-1], LEAD_S + DT_S * np.arange(N_FRAMES), atol=1e-6)
        np.testing.assert_allclose(positions[1:-1], track.positions, atol=1e-6)
        _, turns = glb.curve(node, "rotation")
        difference = yaw_of(turns[1:-1].astype(float)) - track.yaws_rad
        np.testing.assert_allclose(np.exp(1j * difference), 1.0, atol=1e-6)


def test_first_and_last_pose_are_held(scenes: tuple[Scene, Scene]) -> None:
    glb = read(build_clip(*scenes, Layout.WIDE))
    for node in glb.moving():
        times, positions = glb.curve(node, "translation")
        assert times[0] == 0
        assert times[1] == pytest.approx(LEAD_S)
        assert times[-1] - times[-2] == pytest.approx(TAIL_S, abs=1e-6)
        np.testing.assert_array_equal(positions[0], positions[1])
        np.testing.assert_array_equal(positions[-1], positions[-2])


def test_all_cars_share_one_loop_even_if_one_side_is_shorter() -> None:
    short = drive()
    short = Scene(short.tracks, short.ground, 0.06, short.bounds, short.background)
    glb = read(build_clip(drive(), short, Layout.WIDE))
    ends = [float(glb.curve(node, "translation")[0][-1]) for node in glb.moving()]
    assert ends == pytest.approx([duration_s(drive(), short)] * 4)


@pytest.mark.parametrize("start_s", [0.2, 0.6, 2.345, 6.0, 6.39])
def test_a_clip_may_begin_anywhere_in_the_loop(scenes: tuple[Scene, Scene], start_s: float) -> None:
    whole, later = read(build_clip(*scenes, Layout.WIDE)), read(build_clip(*scenes, Layout.WIDE, start_s))
    end_s = duration_s(*scenes)
    for node in whole.moving():
        times, positions = whole.curve(node, "translation")
        shifted_times, shifted = later.curve(node, "translation")
        assert (np.diff(shifted_times) > 0).all()
        for at_s in np.linspace(0.013, end_s - 0.013, 91):
            if abs(at_s + start_s - end_s) < 0.01:
                continue  # the jump from the last pose to the first
            here = [np.interp((start_s + at_s) % end_s, times, c) for c in positions.T]
            there = [np.interp(at_s, shifted_times, c) for c in shifted.T]
            np.testing.assert_allclose(there, here, atol=2e-3)


def test_a_frozen_clip_stands_still_at_its_moment(scenes: tuple[Scene, Scene]) -> None:
    glb = read(build_clip(*scenes, Layout.TALL, LEAD_S + 2.34, frozen=True))
    assert "animations" not in glb.document
    for node, (scene, i) in zip(glb.moving(), [(s, i) for s in scenes for i in (0, 1)], strict=True):
        pose = expected(scene, i, 2.34)
        np.testing.assert_allclose(glb.document["nodes"][node]["translation"], pose[:3], atol=1e-6)
        turn = np.array(glb.document["nodes"][node]["rotation"])
        assert np.exp(1j * (yaw_of(turn) - pose[3])) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_another_speed_stretches_the_same_motion(scenes: tuple[Scene, Scene], speed: float) -> None:
    usual, other = (read(build_clip(*scenes, Layout.WIDE, 1.3, speed=each)) for each in (1.0, speed))
    for node in usual.moving():
        for path in ("translation", "rotation"):
            times, values = usual.curve(node, path)
            stretched, same = other.curve(node, path)
            np.testing.assert_allclose(stretched * speed, times, rtol=1e-6)
            np.testing.assert_array_equal(same, values)


@dataclass(frozen=True)
class Square:
    """A small square that faces the viewer: its middle, how far it reaches, and its colour for the renderer."""

    middle: tuple[float, float, float]
    reach: float
    colour: tuple[float, ...]


def squares(glb: Glb) -> list[Square]:
    found = []
    for primitive in [primitive for mesh in glb.document["meshes"] for primitive in mesh["primitives"]]:
        points = glb.array(primitive["attributes"]["POSITION"])
        if np.ptp(points[:, :2], axis=0).max() < 0.03 and points[:, 2].min() > 1:
            material = glb.document["materials"][primitive["material"]]
            colour = tuple(material["pbrMetallicRoughness"]["baseColorFactor"])
            low, high = points.min(axis=0), points.max(axis=0)
            x, y, z = ((low + high) / 2).tolist()
            found.append(Square((round(x, 4), round(y, 4), round(z, 4)), float(high[0] - low[0]) / 2, colour))
    return found


def depths(clip: bytes, layout: Layout) -> tuple[float, float]:
    """How near the lowest and the highest of a clip's triangles are, beside the ground, in each half.

    Written anew from glTF's definition of a node, and from what a similarity does to a plane: the ground is the
    plane of all points whose scene height is nought.
    """
    glb = read(clip)
    nodes = glb.document["nodes"]
    roots = [nodes[i] for i in glb.document["scenes"][0]["nodes"]]
    heights = []
    for centre, root in zip(
        half_centres(layout), [root for root in roots if "children" in root], strict=True
    ):
        x, y, z, w = root["rotation"]
        # The last column of the rotation matrix: where the scene's upward direction points.
        normal = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        # The ground runs through the middle of the half.
        assert normal @ (root["translation"] - centre) == pytest.approx(0.0, abs=1e-6)
        for child in (nodes[i] for i in root["children"]):
            for primitive in glb.document["meshes"][child["mesh"]]["primitives"]:
                points = glb.array(primitive["attributes"]["POSITION"])
                heights.append(points[:, 2] * root["scale"][0] / normal[2])
        backdrop = roots[roots.index(root) - 1]
        [primitive] = glb.document["meshes"][backdrop["mesh"]]["primitives"]
        points = glb.array(primitive["attributes"]["POSITION"])
        heights.append((points - centre) @ normal / normal[2])
    return float(np.concatenate(heights).min()), float(np.concatenate(heights).max())


@pytest.mark.parametrize("layout", Layout)
@pytest.mark.parametrize("length", [0.4, 4.2, 30.0])
def test_a_clip_that_is_one_level_nearer_hides_another_wholly(layout: Layout, length: float) -> None:
    low, high = depths(build_clip(drive(length=length), drive(), layout), layout)
    assert -0.1 * LEVEL_Z < low < 0.0 < high < 0.8 * LEVEL_Z
    # And looks no larger: less than half a pixel at the edge of a screen of 1,080.
    assert 540 * LEVEL_Z / CAMERA.position[2] < 0.5


@pytest.mark.parametrize("layout", Layout)
def test_mark_and_flag_lie_in_front_of_everything_between_the_sides(
    scenes: tuple[Scene, Scene], layout: Layout
) -> None:
    glb = read(build_clip(*scenes, layout, mark=5, flag=6))
    mark, flag = squares(glb)
    # The backdrops reach farther than the ground, in its plane.
    roots = [glb.document["nodes"][i] for i in glb.document["scenes"][0]["nodes"]]
    meshes = [glb.document["meshes"][root["mesh"]] for root in roots if "mesh" in root]
    flat = [glb.array(mesh["primitives"][0]["attributes"]["POSITION"]) for mesh in meshes]
    nearest = max(float(points[:, 2].max()) for points in flat if np.ptp(points[:, :2], axis=0).max() > 0.5)
    for square in (mark, flag):
        assert square.middle[2] > nearest + 3 * LEVEL_Z
        assert CAMERA.position[2] - square.middle[2] - 2 * LEVEL_Z > CAMERA.near
    assert mark.middle[:2] == (0.0, 0.0)
    along = 0 if layout is Layout.WIDE else 1
    assert flag.middle[along] > mark.reach + flag.reach
    assert flag.middle[1 - along] == 0.0


def test_each_of_eight_pictures_in_a_row_has_a_mark_of_its_own_and_each_of_eight_clips_a_flag(
    scenes: tuple[Scene, Scene],
) -> None:
    marks, flags = [], []
    for number in range(N_MARKS + 1):
        clip = build_clip(*scenes, Layout.WIDE, 2.0, frozen=number % 2 == 0, mark=number, flag=number)
        mark, flag = squares(read(clip))
        marks.append(mark.colour)
        flags.append(flag.colour)
    assert len(set(marks)) == N_MARKS == N_FLAGS
    assert marks[0] == marks[N_MARKS]
    assert flags == marks


def test_a_mark_says_its_number_in_bits() -> None:
    for number in range(-3, 20):
        colour = mark_colour(number)
        bits = [int(colour[i : i + 2], 16) > 0x80 for i in (1, 3, 5)]
        assert bits[0] + 2 * bits[1] + 4 * bits[2] == number % N_MARKS


@pytest.mark.parametrize("layout", Layout)
def test_each_side_is_placed_as_framed(scenes: tuple[Scene, Scene], layout: Layout) -> None:
    a, b = scenes
    framing = frame(a.bounds.union(b.bounds), layout)
    roots = [node for node in read(build_clip(a, b, layout)).document["nodes"] if "children" in node]
    for root, placement in zip(roots, (framing.a, framing.b), strict=True):
        x, y, z, w = root["rotation"]
        point = np.array([0.3, 1.7, 0.1])
        axis = np.array([x, y, z])
        turned = point + 2 * np.cross(axis, np.cross(axis, point) + w * point)
        placed = np.array(root["translation"]) + root["scale"][0] * turned
        np.testing.assert_allclose(placed, placement.apply(point[None])[0], atol=1e-9)


@pytest.mark.parametrize("layout", Layout)
def test_ground_stays_in_its_own_half(scenes: tuple[Scene, Scene], layout: Layout) -> None:
    a, b = scenes
    framing = frame(a.bounds.union(b.bounds), layout)
    glb = read(build_clip(a, b, layout))
    across = 1 if layout is Layout.WIDE else 0
    grounds = [node for node in glb.document["nodes"] if node.get("name") == "ground"]
    for node, placement, centre in zip(grounds, (framing.a, framing.b), half_centres(layout), strict=True):
        [primitive] = glb.document["meshes"][node["mesh"]]["primitives"]
        points = placement.apply(glb.array(primitive["attributes"]["POSITION"]).astype(float)) - centre
        assert np.abs(points[:, across]).max() <= half_extents(layout)[across] + 1e-5
        along = points[:, 1 - across]
        assert np.ptp(along) >= 2 * half_extents(layout)[1 - across]  # the road runs right through


def test_both_sides_share_their_meshes(scenes: tuple[Scene, Scene]) -> None:
    nodes = read(build_clip(*scenes, Layout.WIDE)).document["nodes"]
    meshes = [node["mesh"] for node in nodes if node.get("name")]
    assert meshes[:3] == meshes[3:]


def test_equal_scenes_give_equal_bytes() -> None:
    assert build_clip(drive(), drive(0.1), Layout.WIDE, 1.5) == build_clip(
        drive(), drive(0.1), Layout.WIDE, 1.5
    )


def test_a_clip_is_built_in_a_moment_and_small(scenes: tuple[Scene, Scene]) -> None:
    size = len(build_clip(*scenes, Layout.WIDE))
    times = []
    for _ in range(30):
        start = time.perf_counter()
        build_clip(*scenes, Layout.WIDE, 0.5)
        times.append(time.perf_counter() - start)
    # 0.7 ms where it was measured; the least of many is what a busy machine can't spoil.
    assert min(times) < 0.003
    assert size < 120_000
