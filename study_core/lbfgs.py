"""Bounded L-BFGS, many climbs as one batch.

Each row of the batch is an independent minimisation of -R within the controls' bounds: a projected quasi-Newton
method whose direction is the two-loop recursion on the variables that are free to move, and whose step is
backtracked along the projected path (Bertsekas 1982; Nocedal and Wright 2006, ch. 7 and 16). One evaluation of
the domain serves all rows that are still moving.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from study_core import lbfgs_kernels as kernels
from study_core.domain import Domain

VERSION = "projected-lbfgs-1"

_MEMORY = 10
_MAX_EVALUATIONS = 300


def maximise(
    domain: Domain, starts: Float[np.ndarray, "n n_controls"], weights: Float[np.ndarray, "n n_features"]
) -> tuple[Float[np.ndarray, "n n_controls"], Float[np.ndarray, " n"], Bool[np.ndarray, " n"], int]:
    """Climbs from each start under its own weights.

    Returns:
        Controls, rewards and convergence of each row, and the number of evaluations of the batch.
    """
    lower, upper = domain.control_lower, domain.control_upper
    state = kernels.initial_state(np.clip(starts, lower, upper), _MEMORY)
    n_evaluations = 0
    moving: Int[np.ndarray, " n_moving"] = np.arange(len(starts))
    while len(moving) and n_evaluations < _MAX_EVALUATIONS:
        rewards, gradients = domain.reward_and_gradient(state.trial[moving], weights[moving])
        kernels.advance(moving, -rewards, -gradients, lower, upper, *state)
        n_evaluations += 1
        moving = np.flatnonzero(state.status == kernels.MOVING)
    return state.point, -state.value, state.status == kernels.CONVERGED, n_evaluations
