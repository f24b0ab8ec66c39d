"""The car's dynamics in closed form: no loop over steps (Katz et al. 2021, after Sadigh et al. 2017).

One step of `DT_S` from controls (steer, gas), all four from the old state:

    x += dt v cos(theta)    y += dt v sin(theta)    theta += dt v steer    v += dt (gas - v)

The system is triangular. Speed is linear in gas, so all speeds are one matrix product; heading, then
position, are cumulative sums.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

DT_S = 0.1
N_BLOCKS = 5
STEPS_PER_BLOCK = 10
N_STEPS = N_BLOCKS * STEPS_PER_BLOCK

ROBOT_START = np.array([0.0, -0.3, np.pi / 2, 0.4])
HUMAN_START = np.array([0.17, 0.0, np.pi / 2, 0.41])
HUMAN_CONTROLS = np.array([[0.0, 0.41, 1.0, 0.41, -1.0, 0.41, 0.0, 0.533, 0.0, 0.533]])


def _speed_response() -> tuple[
    Float[np.ndarray, " n_steps_plus_1"], Float[np.ndarray, "n_blocks n_steps_plus_1"]
]:
    """Returns how speed at steps 0..N_STEPS answers the start speed, and the gas of each block."""
    decay = (1.0 - DT_S) ** np.arange(N_STEPS + 1)
    lag = np.arange(N_STEPS + 1)[None, :] - 1 - np.arange(N_STEPS)[:, None]
    per_step = np.where(lag >= 0, DT_S * (1.0 - DT_S) ** np.maximum(lag, 0), 0.0)
    return decay, per_step.reshape(N_BLOCKS, STEPS_PER_BLOCK, N_STEPS + 1).sum(axis=1)


SPEED_DECAY, SPEED_GAIN = _speed_response()


def simulate(
    start: Float[np.ndarray, " 4"], controls: Float[np.ndarray, "n 10"]
) -> Float[np.ndarray, "n n_steps_plus_1 4"]:
    """Drives from one start under each row of controls.

    Args:
        start: State [x, y, theta, v].
        controls: (steer, gas) of each of the five blocks, shape `(n, 10)`.

    Returns:
        States at steps 0 to 50, the start included, shape `(n, 51, 4)`.
    """
    steer, gas = controls[:, 0::2], controls[:, 1::2]
    speed = start[3] * SPEED_DECAY + gas @ SPEED_GAIN
    turn = DT_S * speed[:, :-1] * np.repeat(steer, STEPS_PER_BLOCK, axis=1)
    heading = _accumulate(start[2], turn)
    step_length = DT_S * speed[:, :-1]
    x = _accumulate(start[0], step_length * np.cos(heading[:, :-1]))
    y = _accumulate(start[1], step_length * np.sin(heading[:, :-1]))
    return np.stack([x, y, heading, speed], axis=-1)


def _accumulate(start: float, steps: Float[np.ndarray, "n n_steps"]) -> Float[np.ndarray, "n n_steps_plus_1"]:
    """Returns the running total from `start`, `start` included."""
    total = np.empty((steps.shape[0], steps.shape[1] + 1))
    total[:, 0] = 0.0
    np.cumsum(steps, axis=1, out=total[:, 1:])
    return start + total


HUMAN_PATH = simulate(HUMAN_START, HUMAN_CONTROLS)[0]
