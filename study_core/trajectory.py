"""The best trajectory for a reward: bounded L-BFGS from many starts, all of them one batch.

Each row of the batch is an independent minimisation of -R within the controls' bounds: a projected quasi-Newton
method whose direction is the two-loop recursion on the variables that are free to move, and whose step is
backtracked along the projected path (Bertsekas 1982; Nocedal and Wright 2006, ch. 7 and 16). One evaluation of
the domain serves all rows that are still moving.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from study_core import trajectory_kernels as kernels
from study_core.domain import Domain

VERSION = "projected-lbfgs-1"

_MEMORY = 10
_MAX_EVALUATIONS = 300


@dataclass(frozen=True)
class BestTrajectories:
    """The best trajectory found for each weight vector.

    Attributes:
        controls: Shape `(n_weights, n_controls)`.
        rewards: w . Phi of each, shape `(n_weights,)`.
        has_converged: Whether the winning start met the tolerance within the evaluations allowed.
        n_evaluations: Evaluations of the domain, of the whole batch.
    """

    controls: Float[np.ndarray, "n_weights n_controls"]
    rewards: Float[np.ndarray, " n_weights"]
    has_converged: Bool[np.ndarray, " n_weights"]
    n_evaluations: int


def best_trajectories(
    rng: np.random.Generator,
    domain: Domain,
    weights: Float[np.ndarray, "n_weights n_features"],
    n_starts: int,
) -> BestTrajectories:
    """Maximises w . Phi over the controls, from `n_starts` different random starts for each weight vector.

    Args:
        rng: Draws the starts, uniform within the bounds.
        domain: Supplies rewards and gradients.
        weights: One problem a row.
        n_starts: Starts of each problem.
    """
    n_weights, n_controls = len(weights), len(domain.control_lower)
    starts = rng.uniform(domain.control_lower, domain.control_upper, (n_weights * n_starts, n_controls))
    controls, rewards, has_converged, n_evaluations = maximise(
        domain, starts, np.repeat(weights, n_starts, axis=0)
    )
    rows = np.arange(n_weights)
    best = rewards.reshape(n_weights, n_starts).argmax(axis=1)
    winners = rows * n_starts + best
    return BestTrajectories(controls[winners], rewards[winners], has_converged[winners], n_evaluations)


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
