"""Bounded L-BFGS, many climbs as one batch.

Each row of the batch is an independent maximisation within bounds, of a reward or of anything smooth: a projected
quasi-Newton method whose direction is the two-loop recursion on the variables that are free to move, and whose
step is backtracked along the projected path (Bertsekas 1982; Nocedal and Wright 2006, ch. 7 and 16). One
evaluation serves all rows that are still moving.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int

from study_core import lbfgs_kernels as kernels
from study_core.domain import Domain

VERSION = "projected-lbfgs-1"

_MEMORY = 10
_MAX_EVALUATIONS = 300


EvaluateFn = Callable[
    [Float[np.ndarray, "n n_controls"], Int[np.ndarray, " n"]],
    tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_controls"]],
]
"""Takes points and the rows of the batch that they belong to; gives values and gradients."""


def maximise(
    domain: Domain, starts: Float[np.ndarray, "n n_controls"], weights: Float[np.ndarray, "n n_features"]
) -> tuple[Float[np.ndarray, "n n_controls"], Float[np.ndarray, " n"], Bool[np.ndarray, " n"], int]:
    """Climbs from each start under its own weights.

    Returns:
        Controls, rewards and convergence of each row, and the number of evaluations of the batch.
    """

    def evaluate(
        points: Float[np.ndarray, "m n_controls"], rows: Int[np.ndarray, " m"]
    ) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m n_controls"]]:
        return domain.reward_and_gradient(points, weights[rows])

    return climb(evaluate, starts, domain.control_lower, domain.control_upper, _MAX_EVALUATIONS)


def climb(
    evaluate: EvaluateFn,
    starts: Float[np.ndarray, "n n_controls"],
    lower: Float[np.ndarray, " n_controls"],
    upper: Float[np.ndarray, " n_controls"],
    max_evaluations: int,
) -> tuple[Float[np.ndarray, "n n_controls"], Float[np.ndarray, " n"], Bool[np.ndarray, " n"], int]:
    """Climbs any smooth objective from each start, within bounds.

    Returns:
        Points, values and convergence of each row, and the number of evaluations of the batch.
    """
    state = kernels.initial_state(np.clip(starts, lower, upper), _MEMORY)
    n_evaluations = 0
    moving: Int[np.ndarray, " n_moving"] = np.arange(len(starts))
    while len(moving) and n_evaluations < max_evaluations:
        values, gradients = evaluate(state.trial[moving], moving)
        kernels.advance(moving, -values, -gradients, lower, upper, *state)
        n_evaluations += 1
        moving = np.flatnonzero(state.status == kernels.MOVING)
    return state.point, -state.value, state.status == kernels.CONVERGED, n_evaluations
