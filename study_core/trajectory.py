"""The best trajectory for a reward: L-BFGS from random starts, or from the best drives of a bank.

The reward has many local optima, so where a climb starts decides how high it ends. Random starts are the paper's way
(Katz et al. 2021); a bank's drives have been climbed to before, for weights all around, and few of them do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from study_core import trajectory_kernels as kernels
from study_core.bank import Bank
from study_core.domain import Domain
from study_core.errors import BankError
from study_core.lbfgs import maximise

# A drive and its neighbours climb the same hill; starts that look different climb several.
_WARM_STARTS = 3
_LEAST_DIFFERENCE = 0.25


@dataclass(frozen=True)
class BestTrajectories:
    """The best trajectory found for each weight vector.

    Attributes:
        controls: Within the domain's bounds, shape `(n_weights, n_controls)`.
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
    shape = (len(weights), n_starts, len(domain.control_lower))
    return _best_of(domain, rng.uniform(domain.control_lower, domain.control_upper, shape), weights)


def best_from_bank(
    domain: Domain, bank: Bank, weights: Float[np.ndarray, "n_weights n_features"]
) -> BestTrajectories:
    """Maximises w . Phi over the controls, from the bank's best drives that look different.

    The result is at least as good as every drive of the bank, and nothing in it is random.

    Args:
        domain: Supplies rewards and gradients.
        bank: The domain's.
        weights: One problem a row.

    Raises:
        BankError: The bank is another domain's.
    """
    if bank.domain_id != domain.id:
        raise BankError(
            f"Expected a bank of '{domain.id}', got one of '{bank.domain_id}'. Open it with open_bank."
        )
    rows = kernels.warm_starts(bank.features, bank.paths, weights, _WARM_STARTS, _LEAST_DIFFERENCE)
    return _best_of(domain, bank.controls[rows], weights)


def _best_of(
    domain: Domain,
    starts: Float[np.ndarray, "n_weights n_starts n_controls"],
    weights: Float[np.ndarray, "n_weights n_features"],
) -> BestTrajectories:
    """Climbs from all starts of each weight vector, as one batch, and keeps the highest."""
    n_weights, n_starts, n_controls = starts.shape
    controls, rewards, has_converged, n_evaluations = maximise(
        domain, starts.reshape(-1, n_controls), np.repeat(weights, n_starts, axis=0)
    )
    best = rewards.reshape(n_weights, n_starts).argmax(axis=1)
    winners = np.arange(n_weights) * n_starts + best
    return BestTrajectories(controls[winners], rewards[winners], has_converged[winners], n_evaluations)
