"""Hand-coded features and network inputs of a drive (Katz et al. 2021, Table I).

The paper prints the lane feature without its factor -30; the published code and data have it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from study_core.domain import N_
from study_core.domains.driving.dynamics import HUMAN_PATH

LANE_CENTRES = np.array([-0.17, 0.0, 0.17])
LANE_WIDTH = 0.17
ROAD_EDGE = 0.255
LANE_SHARPNESS = 30.0
COLLISION_X, COLLISION_Y = 7.0, 3.0

FEATURE_NAMES = ("lane", "speed", "heading", "collision")
FEATURE_LABELS = (
    N_("Keeping to the middle of a lane"),
    N_("Going at a steady, moderate speed"),
    N_("Driving straight ahead"),
    N_("Keeping clear of the other car"),
)
NETWORK_INPUT_NAMES = ("x", "distance", "heading", "speed", "time_gap")

# Cars whose speeds differ by less than this neither approach nor part, to the time gap.
_LEAST_SPEED_DIFFERENCE = 0.1
# A drive lasts 5 s: a gap that takes longer to open or close says nothing about it.
_LONGEST_TIME_GAP_S = 5.0

# Recorded states are those after each step, so the other car's start is left out as well.
_HUMAN_X, _HUMAN_Y, _HUMAN_SPEED = HUMAN_PATH[1:, 0], HUMAN_PATH[1:, 1], HUMAN_PATH[1:, 3]


def features(states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 4"]:
    """Returns lane, speed, heading and collision, each averaged over the 50 recorded states.

    Args:
        states: [x, y, theta, v] after each step, shape `(n, 50, 4)`.

    Returns:
        Features of each drive, all at most 1 in size for drives within the controls' bounds, shape `(n, 4)`.
    """
    x, y, heading, speed = np.moveaxis(states, -1, 0)
    lane = np.exp(-LANE_SHARPNESS * ((x[..., None] - LANE_CENTRES) ** 2).min(axis=-1))
    collision = -np.exp(-(COLLISION_X * (x - _HUMAN_X) ** 2 + COLLISION_Y * (y - _HUMAN_Y) ** 2))
    per_step = np.stack([lane, -((speed - 1.0) ** 2), np.sin(heading), collision], axis=-1)
    return per_step.mean(axis=1)


def network_inputs(states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 50 5"]:
    """Returns [x, d, theta, v, time gap] at each step; d is the distance to the human car.

    The time gap is the paper's (y - y_h) / (v - v_h): the seconds since the cars were side by side where the
    distance along the road grows, and minus the seconds until they will be where it shrinks. At equal speeds that is
    infinite, or 0 / 0. So it is computed as dy dv / (dv^2 + 0.1^2), which passes through 0 there, and kept within 5 s.
    """
    x, y, heading, speed = np.moveaxis(states, -1, 0)
    distance = np.hypot(x - _HUMAN_X, y - _HUMAN_Y)
    return np.stack([x, distance, heading, speed, _time_gap(y - _HUMAN_Y, speed - _HUMAN_SPEED)], axis=-1)


def _time_gap(
    distance: Float[np.ndarray, "n 50"], speed_difference: Float[np.ndarray, "n 50"]
) -> Float[np.ndarray, "n 50"]:
    gap = distance * speed_difference / (speed_difference**2 + _LEAST_SPEED_DIFFERENCE**2)
    return gap.clip(-_LONGEST_TIME_GAP_S, _LONGEST_TIME_GAP_S)
