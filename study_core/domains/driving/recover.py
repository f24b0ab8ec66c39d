"""The controls of a drive, from its states: the dynamics the other way round.

Within a block steer and gas are constant, and one step (see `dynamics`) says of them

    v' - (1 - dt) v = dt gas    theta' - theta = dt v steer

so each is the least-squares solution of ten equations. Positions have no say, but must come out as given.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from study_core.domains.driving.dynamics import DT_S, N_BLOCKS, ROBOT_START, STEPS_PER_BLOCK, simulate
from study_core.errors import NotATrajectoryError

# Stored drives come back to 4e-15; what differs by more was driven by something else.
_TOLERANCE = 1e-9


def recover_controls(states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 10"]:
    """Returns the controls that lead to the states of each drive.

    Where the car stands still for a whole block its steering can't be told and is 0, which makes no difference.

    Args:
        states: [x, y, theta, v] after each step, shape `(n, 50, 4)`.

    Raises:
        NotATrajectoryError: No controls within their bounds lead to a drive's states to 1e-9; the message names it.
    """
    start = np.broadcast_to(ROBOT_START, (len(states), 1, 4))
    path = np.concatenate([start, states], axis=1)
    heading, speed = path[..., 2], path[..., 3]
    speed_before = _by_block(speed[:, :-1])
    gas = _by_block(speed[:, 1:] - (1.0 - DT_S) * speed[:, :-1]).mean(axis=-1) / DT_S
    turned = np.sum(speed_before * _by_block(np.diff(heading, axis=1)), axis=-1)
    moved = DT_S * np.sum(speed_before**2, axis=-1)
    steer = np.divide(turned, moved, out=np.zeros_like(turned), where=moved > 0.0)
    # A control at its bound may come out a rounding error beyond it.
    controls = np.clip(np.stack([steer, gas], axis=-1).reshape(-1, 2 * N_BLOCKS), -1.0, 1.0)
    _require_the_same(states, simulate(ROBOT_START, controls)[:, 1:])
    return controls


def _by_block(steps: Float[np.ndarray, "n 50"]) -> Float[np.ndarray, "n 5 10"]:
    return steps.reshape(-1, N_BLOCKS, STEPS_PER_BLOCK)


def _require_the_same(states: Float[np.ndarray, "n 50 4"], driven: Float[np.ndarray, "n 50 4"]) -> None:
    errors = np.abs(driven - states).max(axis=(1, 2), initial=0.0)
    wrong = np.flatnonzero(~(errors <= _TOLERANCE))
    if len(wrong):
        raise NotATrajectoryError(
            f"Expected states that controls of driving-v1 lead to, got drive {wrong[0]} of {len(states)}, which is "
            f"{errors[wrong[0]]:.1e} off. Was it driven by other dynamics?"
        )
