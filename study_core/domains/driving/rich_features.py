"""54 features of a whole drive, from a driver's sense of what people may mind: what a linear model learns from.

They are written once, without a look at anybody's answers, and are no reward: signs are left to whoever learns from
them. Distances are in units of the road (a lane is 0.17 wide), times in seconds. Ranges are those of drives within the
controls' bounds; nothing is standardised. "Mean", "largest" and so on are over the 50 recorded states. s is the
logistic function, (dx, dy) the position relative to the other car, d its length.

| group | feature | range | formula |
| --- | --- | --- | --- |
| published | lane | (0, 1] | the hand-coded features: see `features` |
| | speed | [-4, 0] | |
| | heading | [-1, 1] | |
| | collision | [-1, 0) | |
| road | off road | (0, 1) | mean s((abs x - 0.255) / 0.02) |
| | beyond lanes | [0, 4.8] | mean max(abs x - 0.2, 0) |
| | farthest beyond lanes | [0, 1) | tanh(max(abs x - 0.2, 0) / 0.2), its largest |
| | off road at end | (0, 1) | s((abs x - 0.255) / 0.02) of the last state |
| | farthest from middle | [0, 1) | tanh(abs x / 0.3), its largest |
| closeness | closest | (0, 1] | exp(-(7 dx^2 + 3 dy^2)), its largest |
| | touching, longest touching | [0, 1] | exp(-((dx / 0.1)^2 + (dy / 0.2)^2) / 2): largest, mean |
| | least distance | [0, 0.5] | smallest d, at most 0.5 |
| | near | (0, 1) | mean s((0.2 - d) / 0.03) |
| | distance at end | [0, 1] | last d, at most 1 |
| progress | way | [-5.3, 4.7] | last y |
| | way beyond usual | [0, 3.2] | what the last y exceeds 1.5 by |
| | farthest | [-0.3, 4.7] | largest y |
| speed | mean speed, final speed, least speed, greatest speed | [-1, 1] | v |
| | speed variation | [0, 1] | standard deviation of v |
| | backing up | [0, 10] | 10 mean max(-v, 0) |
| | standing or backing | (0, 1) | mean s((0.15 - v) / 0.03) |
| | slow | [0, 1.4] | mean max(0.4 - v, 0) |
| | unlike traffic | [0, 2] | mean abs(v - v of the other car) |
| heading | largest turn, mean turn, final turn | [0, 1.6] | abs(theta - pi/2), each at most 1.6 |
| | turning | [0, 3] | sum of abs changes of theta, at most 3 |
| lane | off centre, off centre at end | [0, 0.3] | distance to the nearest lane centre, each at most 0.3 |
| | side at end, side | [-0.4, 0.4] | x, each clipped: last, mean |
| | swaying | [0, 1] | sum of abs changes of x, at most 1 |
| | lane changes | [0, 49] | how often the nearest lane centre changes |
| | in left lane, in middle lane, in right lane | [0, 1] | mean exp(-((x - centre) / 0.06)^2 / 2) |
| | in middle lane at end | [0, 1] | the same of the last state |
| other car | ahead, ahead at end | (0, 1) | s(dy / 0.1): mean, last |
| | behind in its lane | (0, 1) | mean same s(-dy / 0.1), with same = exp(-(dx / 0.085)^2 / 2) |
| | ahead in its lane | (0, 1) | mean same s(dy / 0.1) |
| | tailing | (0, 1) | mean same exp(-((dy + 0.3) / 0.15)^2 / 2) |
| | cutting in | (0, 1) | mean same exp(-((dy - 0.3) / 0.15)^2 / 2) |
| | beside | (0, 1) | mean (1 - same) exp(-(dy / 0.2)^2 / 2) |
| comfort | acceleration | [0, 2] | mean abs a, a = change of v over 0.1 s |
| | braking | [0, 2] | mean max(-a, 0) |
| | hardest acceleration | [0, 2] | largest abs a |
| | jerk | [0, 20] | mean abs change of a over 0.1 s |
| | steering | [0, 2] | mean abs r, r = change of theta over 0.1 s, each at most 2 |
| | steering changes | [0, 2] | mean abs change of r from step to step, each at most 2 |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import expit

from study_core.domains.driving.dynamics import DT_S, HUMAN_PATH
from study_core.domains.driving.features import (
    COLLISION_X,
    COLLISION_Y,
    FEATURE_NAMES,
    LANE_CENTRES,
    ROAD_EDGE,
    features,
)


@dataclass(frozen=True)
class _Drives:
    """What the groups read, each `(n, 50)`.

    Attributes:
        x, y, heading, speed: The recorded states.
        dx, dy, distance: Where the car is relative to the other car.
        same_lane: How much it is in the other car's lane, within (0, 1].
    """

    x: Float[np.ndarray, "n 50"]
    y: Float[np.ndarray, "n 50"]
    heading: Float[np.ndarray, "n 50"]
    speed: Float[np.ndarray, "n 50"]
    dx: Float[np.ndarray, "n 50"]
    dy: Float[np.ndarray, "n 50"]
    distance: Float[np.ndarray, "n 50"]
    same_lane: Float[np.ndarray, "n 50"]


_Columns = list[Float[np.ndarray, " n"]]


def rich_features(states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 54"]:
    """Returns the features of each drive, in the order of `RICH_FEATURE_NAMES`.

    Args:
        states: [x, y, theta, v] after each step, shape `(n, 50, 4)`.
    """
    drives = _drives(states)
    rich = [column for group in _GROUPS.values() for column in group(drives)]
    return np.column_stack([features(states), *rich])


def _drives(states: Float[np.ndarray, "n 50 4"]) -> _Drives:
    x, y, heading, speed = np.moveaxis(states, -1, 0)
    dx, dy = x - HUMAN_PATH[1:, 0], y - HUMAN_PATH[1:, 1]
    return _Drives(x, y, heading, speed, dx, dy, np.hypot(dx, dy), _bump(dx, 0.085))


def _bump(z: Float[np.ndarray, "..."], width: float) -> Float[np.ndarray, "..."]:
    """Returns 1 at z = 0, falling like a normal density of that width."""
    return np.exp(-((z / width) ** 2) / 2)


def _mean(per_step: Float[np.ndarray, "n n_steps"]) -> Float[np.ndarray, " n"]:
    return per_step.mean(axis=1)


def _total_change(per_step: Float[np.ndarray, "n n_steps"]) -> Float[np.ndarray, " n"]:
    return np.abs(np.diff(per_step)).sum(axis=1)


def _road(drives: _Drives) -> _Columns:
    off_road = expit((np.abs(drives.x) - ROAD_EDGE) / 0.02)
    beyond_lanes = np.maximum(np.abs(drives.x) - 0.2, 0.0)
    return [
        _mean(off_road),
        _mean(beyond_lanes),
        np.tanh(beyond_lanes.max(axis=1) / 0.2),
        off_road[:, -1],
        np.tanh(np.abs(drives.x).max(axis=1) / 0.3),
    ]


def _closeness(drives: _Drives) -> _Columns:
    close = np.exp(-(COLLISION_X * drives.dx**2 + COLLISION_Y * drives.dy**2))
    touching = _bump(drives.dx, 0.1) * _bump(drives.dy, 0.2)
    return [
        close.max(axis=1),
        touching.max(axis=1),
        _mean(touching),
        np.minimum(drives.distance.min(axis=1), 0.5),
        _mean(expit((0.2 - drives.distance) / 0.03)),
        np.minimum(drives.distance[:, -1], 1.0),
    ]


def _progress(drives: _Drives) -> _Columns:
    final = drives.y[:, -1]
    return [final, np.maximum(final - 1.5, 0.0), drives.y.max(axis=1)]


def _speed(drives: _Drives) -> _Columns:
    speed = drives.speed
    return [
        _mean(speed),
        speed[:, -1],
        speed.min(axis=1),
        speed.max(axis=1),
        speed.std(axis=1),
        10.0 * _mean(np.maximum(-speed, 0.0)),
        _mean(expit((0.15 - speed) / 0.03)),
        _mean(np.maximum(0.4 - speed, 0.0)),
        _mean(np.abs(speed - HUMAN_PATH[1:, 3])),
    ]


def _heading(drives: _Drives) -> _Columns:
    turn = np.minimum(np.abs(drives.heading - np.pi / 2), 1.6)
    return [turn.max(axis=1), _mean(turn), turn[:, -1], np.minimum(_total_change(drives.heading), 3.0)]


def _lane(drives: _Drives) -> _Columns:
    offsets = drives.x[..., None] - LANE_CENTRES
    off_centre = np.minimum(np.abs(offsets).min(axis=-1), 0.3)
    nearest = np.abs(offsets).argmin(axis=-1)
    in_lane = _bump(offsets, 0.06)
    side = np.clip(drives.x, -0.4, 0.4)
    return [
        _mean(off_centre),
        off_centre[:, -1],
        side[:, -1],
        _mean(side),
        np.minimum(_total_change(drives.x), 1.0),
        (np.diff(nearest) != 0).sum(axis=1).astype(np.float64),
        *in_lane.mean(axis=1).T,
        in_lane[:, -1, 1],
    ]


def _other_car(drives: _Drives) -> _Columns:
    dy, same_lane = drives.dy, drives.same_lane
    ahead = expit(dy / 0.1)
    return [
        _mean(ahead),
        ahead[:, -1],
        _mean(same_lane * expit(-dy / 0.1)),
        _mean(same_lane * ahead),
        _mean(same_lane * _bump(dy + 0.3, 0.15)),
        _mean(same_lane * _bump(dy - 0.3, 0.15)),
        _mean((1.0 - same_lane) * _bump(dy, 0.2)),
    ]


def _comfort(drives: _Drives) -> _Columns:
    acceleration = np.diff(drives.speed) / DT_S
    steering = np.diff(drives.heading) / DT_S
    return [
        _mean(np.abs(acceleration)),
        _mean(np.maximum(-acceleration, 0.0)),
        np.abs(acceleration).max(axis=1),
        _mean(np.abs(np.diff(acceleration))) / DT_S,
        _mean(np.minimum(np.abs(steering), 2.0)),
        _mean(np.minimum(np.abs(np.diff(steering)), 2.0)),
    ]


# Each group beside the names of its columns, in their order.
_GROUPS: dict[tuple[str, ...], Callable[[_Drives], _Columns]] = {
    (
        "off road",
        "beyond lanes",
        "farthest beyond lanes",
        "off road at end",
        "farthest from middle",
    ): _road,
    ("closest", "touching", "longest touching", "least distance", "near", "distance at end"): _closeness,
    ("way", "way beyond usual", "farthest"): _progress,
    (
        "mean speed",
        "final speed",
        "least speed",
        "greatest speed",
        "speed variation",
        "backing up",
        "standing or backing",
        "slow",
        "unlike traffic",
    ): _speed,
    ("largest turn", "mean turn", "final turn", "turning"): _heading,
    (
        "off centre",
        "off centre at end",
        "side at end",
        "side",
        "swaying",
        "lane changes",
        "in left lane",
        "in middle lane",
        "in right lane",
        "in middle lane at end",
    ): _lane,
    (
        "ahead",
        "ahead at end",
        "behind in its lane",
        "ahead in its lane",
        "tailing",
        "cutting in",
        "beside",
    ): _other_car,
    ("acceleration", "braking", "hardest acceleration", "jerk", "steering", "steering changes"): _comfort,
}

RICH_FEATURE_NAMES = (*FEATURE_NAMES, *(name for names in _GROUPS for name in names))
