"""Every registered domain keeps the contract, and the checker names whatever breaks it."""

from copy import copy
from dataclasses import replace
from importlib.metadata import entry_points

import numpy as np
import pytest

from study_core.domain import ENTRY_POINT_GROUP, Domain, domain_named
from study_core.domain_check import check_domain
from study_core.domains.driving.domain import Driving
from study_core.errors import DomainError, UnknownNameError
from study_core.scene import Bounds

REGISTERED = sorted(entry.name for entry in entry_points(group=ENTRY_POINT_GROUP))


@pytest.mark.parametrize("name", REGISTERED)
@pytest.mark.parametrize("seed", range(3))
def test_a_registered_domain_keeps_the_contract(name, seed):
    domain = domain_named(name)
    assert domain.id == name
    assert isinstance(domain, Domain)
    check_domain(domain, np.random.default_rng(seed))


def test_the_papers_domain_is_registered():
    assert "driving-v1" in REGISTERED


def test_a_misspelt_domain_is_answered_with_the_closest_name():
    with pytest.raises(UnknownNameError) as raised:
        domain_named("drivng-v1")
    assert str(raised.value) == "No domain named 'drivng-v1'. Did you mean 'driving-v1'?"


def test_an_unlike_name_is_answered_with_all_names():
    with pytest.raises(UnknownNameError, match=r"Known: .*driving-v1"):
        domain_named("zzz")


def broken(**members):
    """Driving with some members replaced."""
    return type("Broken", (Driving,), members)()


DRIVING = Driving()
GOOD_SCENE = DRIVING.scene(np.zeros(10))


class Counter:
    """Gives another number at every call."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return self.calls * 1e-3


def drifting(method):
    count = Counter()
    return lambda self, *given: method(self, *given) + count()


def writes_to_its_input(method):
    def writing(self, values, *rest):
        result = method(self, values, *rest)
        values += 1.0
        return result

    return writing


def reuses_its_buffer(method):
    buffers = {}

    def reusing(self, values):
        result = method(self, values)
        buffer = buffers.setdefault(result.shape, np.empty_like(result))
        buffer[:] = result
        return buffer

    return reusing


def mixes_rows(method):
    return lambda self, values: method(self, values) + 0.01 * len(values)


def rewards(change):
    return lambda self, controls, weights: change(*Driving.reward_and_gradient(self, controls, weights))


def one_gradient_entry_off(reward, gradient):
    wrong = gradient.copy()
    wrong[:, 7] *= 1.001
    return reward, wrong


def only_the_first_weights(self, controls, weights):
    return Driving.reward_and_gradient(self, controls, np.repeat(weights[:1], len(weights), axis=0))


def scene_with(**changes):
    return lambda self, controls: replace(DRIVING.scene(controls), **changes)


def with_track(**changes):
    """Past the shape checks that only tests have."""

    def changed(self, controls):
        scene = DRIVING.scene(controls)
        track = copy(scene.tracks[1])
        for name, value in changes.items():
            object.__setattr__(track, name, value)
        return replace(scene, tracks=(scene.tracks[0], track))

    return changed


def with_colour(colour):
    mesh = replace(GOOD_SCENE.ground[0], colour=colour)
    return scene_with(ground=(*GOOD_SCENE.ground[1:], mesh))


def a_car_out_of_the_picture(self, controls):
    scene = DRIVING.scene(controls)
    return replace(scene, bounds=replace(scene.bounds, y_max=scene.bounds.y_max - 0.1))


def a_scene_of_chance():
    count = Counter()
    return lambda self, controls: replace(DRIVING.scene(controls), dt_s=0.1 + count())


def ends_when_it_likes(self, controls):
    scene = DRIVING.scene(controls)
    n_frames = 20 + int(10 * controls[0])
    tracks = tuple(
        replace(track, positions=track.positions[:n_frames], yaws_rad=track.yaws_rad[:n_frames])
        for track in scene.tracks
    )
    return replace(scene, tracks=tracks)


def raises(self, controls):
    raise RuntimeError("no road")


human = GOOD_SCENE.tracks[1]

BREACHES = {
    "no version": ({"id": "driving"}, "`id`"),
    "an empty feature name": ({"feature_names": ("lane", "", "heading", "collision")}, "`feature_names`"),
    "a name twice": ({"network_input_names": ("x", "x", "heading", "speed")}, "`network_input_names`"),
    "a list of names": ({"feature_names": ["lane", "speed", "heading", "collision"]}, "`feature_names`"),
    "a feature without a label": ({"feature_labels": ("a", "b", "c")}, "`feature_labels`"),
    "too many feature names": ({"feature_names": ("a", "b", "c", "d", "e")}, "`features`"),
    "too many rich names": (
        {"rich_feature_names": (*Driving.rich_feature_names, "luck")},
        "`rich_features`",
    ),
    "a rich name twice": (
        {"rich_feature_names": ("lane", *Driving.rich_feature_names[:-1])},
        "`rich_feature_names`",
    ),
    "rich features of chance": (
        {"rich_features": drifting(Driving.rich_features)},
        "`rich_features` to be deterministic",
    ),
    "rich features that write": (
        {"rich_features": writes_to_its_input(Driving.rich_features)},
        "`rich_features` to leave its inputs alone",
    ),
    "rich features of mixed rows": (
        {"rich_features": mixes_rows(Driving.rich_features)},
        "`rich_features` to give each trajectory of a batch",
    ),
    "infinite rich features": (
        {"rich_features": lambda self, s: Driving.rich_features(self, s) + np.inf},
        "`rich_features` to be finite",
    ),
    "too few input names": ({"network_input_names": ("x",)}, "`network_inputs`"),
    "an infinite bound": ({"control_upper": np.full(10, np.inf)}, "`control_upper`"),
    "a missing bound": ({"control_lower": np.full(10, np.nan)}, "`control_lower`"),
    "bounds the wrong way round": (
        {"control_lower": np.full(10, 2.0)},
        "`control_lower` below `control_upper`",
    ),
    "bounds that meet": (
        {"control_lower": np.r_[np.full(9, -1.0), 1.0]},
        "`control_lower` below `control_upper`",
    ),
    "bounds of two lengths": ({"control_lower": np.full(9, -1.0)}, "`control_lower` below `control_upper`"),
    "bounds of integers": ({"control_lower": np.full(10, -1)}, "`control_lower`"),
    "bounds in a tuple": ({"control_lower": (-1.0,) * 10}, "`control_lower`"),
    "a rollout that raises": ({"rollout": raises}, "`rollout`"),
    "a rollout of chance": ({"rollout": drifting(Driving.rollout)}, "`rollout` to be deterministic"),
    "features of chance": ({"features": drifting(Driving.features)}, "`features` to be deterministic"),
    "inputs of chance": (
        {"network_inputs": drifting(Driving.network_inputs)},
        "`network_inputs` to be deterministic",
    ),
    "a rollout that writes": (
        {"rollout": writes_to_its_input(Driving.rollout)},
        "`rollout` to leave its inputs alone",
    ),
    "features that write": (
        {"features": writes_to_its_input(Driving.features)},
        "`features` to leave its inputs alone",
    ),
    "inputs that write": (
        {"network_inputs": writes_to_its_input(Driving.network_inputs)},
        "`network_inputs` to leave its inputs alone",
    ),
    "rewards that write": (
        {"reward_and_gradient": writes_to_its_input(Driving.reward_and_gradient)},
        "`reward_and_gradient` to leave its inputs alone",
    ),
    "a rollout that reuses its buffer": (
        {"rollout": reuses_its_buffer(Driving.rollout)},
        "`rollout` to return a new array",
    ),
    "a rollout of mixed rows": (
        {"rollout": mixes_rows(Driving.rollout)},
        "`rollout` to give each trajectory of a batch",
    ),
    "features of mixed rows": (
        {"features": mixes_rows(Driving.features)},
        "`features` to give each trajectory of a batch",
    ),
    "inputs of mixed rows": (
        {"network_inputs": mixes_rows(Driving.network_inputs)},
        "`network_inputs` to give each trajectory of a batch",
    ),
    "a rollout without its batch": ({"rollout": lambda self, c: Driving.rollout(self, c)[0]}, "`rollout`"),
    "a rollout in single precision": (
        {"rollout": lambda self, c: Driving.rollout(self, c).astype(np.float32)},
        "`rollout` to be an array of float64",
    ),
    "a rollout with a NaN": (
        {"rollout": lambda self, c: Driving.rollout(self, c) * np.nan},
        "`rollout` to be finite",
    ),
    "infinite features": (
        {"features": lambda self, s: Driving.features(self, s) + np.inf},
        "`features` to be finite",
    ),
    "inputs of one step": (
        {"network_inputs": lambda self, s: Driving.network_inputs(self, s)[:, :1]},
        "`network_inputs`",
    ),
    "rewards without a gradient": (
        {"reward_and_gradient": rewards(lambda reward, _: reward)},
        "rewards and gradients",
    ),
    "rewards slightly off": (
        {"reward_and_gradient": rewards(lambda reward, gradient: (reward + 1e-7, gradient))},
        "the reward of `reward_and_gradient` to be w . features",
    ),
    "rewards with a turned sign": (
        {"reward_and_gradient": rewards(lambda reward, gradient: (-reward, -gradient))},
        "the reward of `reward_and_gradient` to be w . features",
    ),
    "a gradient with a turned sign": (
        {"reward_and_gradient": rewards(lambda reward, gradient: (reward, -gradient))},
        "the gradient of `reward_and_gradient`",
    ),
    "one gradient entry off by a thousandth": (
        {"reward_and_gradient": rewards(one_gradient_entry_off)},
        "the gradient of `reward_and_gradient` in control 7",
    ),
    "a gradient of another shape": (
        {"reward_and_gradient": rewards(lambda reward, gradient: (reward, gradient[:, :5]))},
        "`reward_and_gradient`",
    ),
    "weights of the first row for all": (
        {"reward_and_gradient": only_the_first_weights},
        "`reward_and_gradient` to give each trajectory of a batch",
    ),
    "no scene": ({"scene": lambda self, c: None}, "`scene`"),
    "a scene that raises": ({"scene": raises}, "`scene`"),
    "a scene without tracks": ({"scene": scene_with(tracks=())}, "at least one track"),
    "a scene that stands still": ({"scene": scene_with(dt_s=0.0)}, "`dt_s`"),
    "a scene that runs backwards": ({"scene": scene_with(dt_s=-0.1)}, "`dt_s`"),
    "a scene without a rate": ({"scene": scene_with(dt_s=float("nan"))}, "`dt_s`"),
    "tracks of two lengths": (
        {"scene": with_track(positions=human.positions[:-1], yaws_rad=human.yaws_rad[:-1])},
        "as many frames",
    ),
    "fewer yaws than positions": ({"scene": with_track(yaws_rad=human.yaws_rad[:-1])}, "the yaws of track"),
    "a position that is not a number": (
        {"scene": with_track(positions=human.positions * np.nan)},
        "the positions of track",
    ),
    "positions on a plane": (
        {"scene": with_track(positions=human.positions[:, :2].copy())},
        "the positions of track",
    ),
    "a length that depends on the drive": (
        {"scene": ends_when_it_likes},
        "every scene of 'driving-v1' to have as many tracks and frames",
    ),
    "a body without a size": (
        {"scene": with_track(body=replace(human.body, meshes=()))},
        "body 'human_car' to have a size",
    ),
    "a background by name": ({"scene": scene_with(background="green")}, "'green'"),
    "a colour without its hash": ({"scene": with_colour("1f5fd0")}, "'1f5fd0'"),
    "a colour too short": ({"scene": with_colour("#12345")}, "'#12345'"),
    "bounds of no size": ({"scene": scene_with(bounds=Bounds(0.0, 0.0, 0.0, 0.0))}, "finite bounds"),
    "bounds that are infinite": (
        {"scene": scene_with(bounds=Bounds(-9.0, 9.0, -9.0, float("inf")))},
        "finite bounds",
    ),
    "bounds that cut a car": ({"scene": a_car_out_of_the_picture}, "the scene's bounds to hold"),
    "a mesh with a corner too many": (
        {
            "scene": scene_with(
                ground=(replace(GOOD_SCENE.ground[0], vertices=GOOD_SCENE.ground[0].vertices[:-1]),)
            )
        },
        "the triangles of a mesh",
    ),
    "a scene of chance": ({"scene": a_scene_of_chance()}, "`scene` to be deterministic"),
    "a scene that writes": (
        {"scene": writes_to_its_input(Driving.scene)},
        "`scene` to leave its inputs alone",
    ),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_a_breach_is_caught_and_named(breach):
    members, named = BREACHES[breach]
    with pytest.raises(DomainError) as raised:
        check_domain(broken(**members), np.random.default_rng(0))
    message = str(raised.value)
    assert named in message
    assert message.startswith("Expected ")
    assert message.endswith(".")


@pytest.mark.parametrize(
    "member",
    [
        "id",
        "feature_names",
        "feature_labels",
        "rich_feature_names",
        "control_upper",
        "rollout",
        "features",
        "rich_features",
        "network_inputs",
        "reward_and_gradient",
        "scene",
    ],
)
def test_a_missing_member_is_named(member):
    class Incomplete:
        def __getattr__(self, name):
            if name == member:
                raise AttributeError(name)
            return getattr(DRIVING, name)

    with pytest.raises(DomainError, match=rf"lacks: {member}\. "):
        check_domain(Incomplete(), np.random.default_rng(0))


def test_a_domain_with_other_sizes_and_bounds_passes():
    """Nothing in the checker is about driving."""

    class Reach:
        """One joint of a crane: two controls, three steps, one state, one feature."""

        id = "crane-v12"
        feature_names = ("height",)
        feature_labels = ("Going high",)
        rich_feature_names = ("height", "highest")
        network_input_names = ("angle", "angle squared")
        control_lower, control_upper = np.array([-3.0, 10.0]), np.array([-1.0, 20.0])

        def rollout(self, controls):
            return np.cumsum(np.repeat((controls * [0.1, 0.01]).sum(axis=1)[:, None], 3, axis=1), axis=1)[
                :, :, None
            ]

        def features(self, states):
            return np.sin(states).mean(axis=1)

        def rich_features(self, states):
            return np.column_stack([self.features(states), np.sin(states).max(axis=1)])

        def network_inputs(self, states):
            return np.concatenate([states, states**2], axis=2)

        def reward_and_gradient(self, controls, weights):
            states = self.rollout(controls)
            slope = (np.cos(states[:, :, 0]) * [1.0, 2.0, 3.0]).mean(axis=1)[:, None] * weights
            return (self.features(states) * weights).sum(axis=1), slope * [0.1, 0.01]

        def scene(self, controls):
            return GOOD_SCENE

    check_domain(Reach(), np.random.default_rng(0))
