"""Reward of a drive and its gradient, compiled: the optimiser's inner loop.

The forward pass is `dynamics.simulate` and `features.features`; the backward pass is their adjoint. Both
are one compiled sweep over the steps, because a cumulative sum and its adjoint, fused, need no temporaries.
"""

import math

import numpy as np
from numba import njit

from study_core.domains.driving.dynamics import (
    DT_S,
    HUMAN_PATH,
    N_BLOCKS,
    N_STEPS,
    ROBOT_START,
    SPEED_DECAY,
    SPEED_GAIN,
    STEPS_PER_BLOCK,
)
from study_core.domains.driving.features import COLLISION_X, COLLISION_Y, LANE_SHARPNESS, LANE_WIDTH

_HUMAN_X, _HUMAN_Y = np.ascontiguousarray(HUMAN_PATH[1:, 0]), np.ascontiguousarray(HUMAN_PATH[1:, 1])
_FREE_SPEED = ROBOT_START[3] * SPEED_DECAY
_X0, _Y0, _HEADING0 = ROBOT_START[0], ROBOT_START[1], ROBOT_START[2]


@njit(cache=True)
def rewards_and_gradients(controls, weights):
    """Returns rewards `(n,)` and their gradients `(n, 10)` for controls `(n, 10)` and weights `(n, 4)`."""
    n = controls.shape[0]
    rewards = np.empty(n)
    gradients = np.empty((n, 2 * N_BLOCKS))
    speed = np.empty(N_STEPS + 1)
    sine = np.empty(N_STEPS + 1)
    cosine = np.empty(N_STEPS + 1)
    reward_x = np.empty(N_STEPS)
    reward_y = np.empty(N_STEPS)
    for i in range(n):
        _speeds(controls[i], speed)
        rewards[i] = _forward(controls[i], weights[i], speed, sine, cosine, reward_x, reward_y)
        _backward(controls[i], weights[i], speed, sine, cosine, reward_x, reward_y, gradients[i])
    return rewards, gradients


@njit(cache=True)
def _speeds(controls, speed):
    for t in range(N_STEPS + 1):
        speed[t] = _FREE_SPEED[t]
    for b in range(N_BLOCKS):
        gas = controls[2 * b + 1]
        for t in range(N_STEPS + 1):
            speed[t] += gas * SPEED_GAIN[b, t]


@njit(cache=True)
def _forward(controls, weights, speed, sine, cosine, reward_x, reward_y):
    """Fills sin and cos of the heading and the reward's slope in x and y at each step; returns the reward."""
    x, y, heading = _X0, _Y0, _HEADING0
    sine[0], cosine[0] = math.sin(heading), math.cos(heading)
    total = 0.0
    for t in range(N_STEPS):
        step_length = DT_S * speed[t]
        x += step_length * cosine[t]
        y += step_length * sine[t]
        heading += step_length * controls[2 * (t // STEPS_PER_BLOCK)]
        sine[t + 1], cosine[t + 1] = math.sin(heading), math.cos(heading)
        # The centres are one lane width apart, so the nearest one is a rounding away.
        off_centre = x - LANE_WIDTH * min(1.0, max(-1.0, np.rint(x / LANE_WIDTH)))
        lane = math.exp(-LANE_SHARPNESS * off_centre * off_centre)
        dx, dy = x - _HUMAN_X[t], y - _HUMAN_Y[t]
        closeness = math.exp(-(COLLISION_X * dx * dx + COLLISION_Y * dy * dy))
        too_slow = speed[t + 1] - 1.0
        total += (
            weights[0] * lane
            - weights[1] * too_slow * too_slow
            + weights[2] * sine[t + 1]
            - weights[3] * closeness
        )
        reward_x[t] = -weights[0] * 2.0 * LANE_SHARPNESS * off_centre * lane
        reward_x[t] += weights[3] * 2.0 * COLLISION_X * dx * closeness
        reward_y[t] = weights[3] * 2.0 * COLLISION_Y * dy * closeness
    return total / N_STEPS


@njit(cache=True)
def _backward(controls, weights, speed, sine, cosine, reward_x, reward_y, gradient):
    """Sweeps the adjoint of the dynamics from the last step to the first; fills `gradient`."""
    gradient[:] = 0.0
    slope_x, slope_y, slope_heading = 0.0, 0.0, 0.0
    for t in range(N_STEPS - 1, -1, -1):
        block = t // STEPS_PER_BLOCK
        steer = controls[2 * block]
        slope_x += reward_x[t]
        slope_y += reward_y[t]
        slope_heading += weights[2] * cosine[t + 1]
        gradient[2 * block] += slope_heading * DT_S * speed[t]
        slope_speed = DT_S * (slope_x * cosine[t] + slope_y * sine[t] + slope_heading * steer)
        arrived_speed = -2.0 * weights[1] * (speed[t + 1] - 1.0)
        for b in range(N_BLOCKS):
            gradient[2 * b + 1] += slope_speed * SPEED_GAIN[b, t] + arrived_speed * SPEED_GAIN[b, t + 1]
        slope_heading += DT_S * speed[t] * (slope_y * cosine[t] - slope_x * sine[t])
    for k in range(2 * N_BLOCKS):
        gradient[k] /= N_STEPS
