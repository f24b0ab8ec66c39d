"""Hand-coded features and network inputs of a drive (Katz et al. 2021, Table I).

The paper prints the lane feature without its factor -30; the published code and data have it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from study_core.domains.driving.dynamics import HUMAN_PATH

LANE_CENTRES = np.array([-0.17, 0.0, 0.17])
LANE_WIDTH = 0.17
ROAD_EDGE = 0.255
LANE_SHARPNESS = 30.0
COLLISION_X, COLLISION_Y = 7.0, 3.0

FEATURE_NAMES = ("lane", "speed", "heading", "collision")
NETWORK_INPUT_NAMES = ("x", "distance", "heading", "speed")

# Recorded states are those after each step, so the other car's start is left out as well.
_HUMAN_X, _HUMAN_Y = HUMAN_PATH[1:, 0], HUMAN_PATH[1:, 1]


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


def network_inputs(states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 50 4"]:
    """Returns [x, d, theta, v] at each step; d is the distance to the human car."""
    x, y, heading, speed = np.moveaxis(states, -1, 0)
    distance = np.hypot(x - _HUMAN_X, y - _HUMAN_Y)
    return np.stack([x, distance, heading, speed], axis=-1)
