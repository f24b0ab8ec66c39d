"""Convergence diagnostics of all draws: rank-normalised R-hat, bulk and tail ESS (Vehtari et al. 2021)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri

from study_core.posterior import diagnostics_kernels as kernels

# Vehtari et al. (2021), section 4, ask for an R-hat of 1.01 and an ESS of 400. An ESS of 1,000 gives the 5 % and 95 %
# quantiles, too, to a hundredth of the distribution.
LARGEST_R_HAT = 1.01
SMALLEST_ESS = 1000.0


@dataclass(frozen=True)
class Diagnostics:
    """How far the draws can be trusted.

    Attributes:
        r_hat: Largest rank-normalised split R-hat of each quantity, bulk and folded, shape `(n_quantities,)`.
        ess_bulk: Bulk effective sample size of each quantity, shape `(n_quantities,)`.
        ess_tail: Smaller effective sample size of the 5 % and 95 % quantiles, shape `(n_quantities,)`.
        acceptance: Share of proposals accepted.
        n_draws: How many draws there are, of all chains.
    """

    r_hat: Float[np.ndarray, " n_quantities"]
    ess_bulk: Float[np.ndarray, " n_quantities"]
    ess_tail: Float[np.ndarray, " n_quantities"]
    acceptance: float
    n_draws: int

    @property
    def has_converged(self) -> bool:
        """Returns whether every quantity meets `LARGEST_R_HAT` and `SMALLEST_ESS`."""
        ess = np.minimum(self.ess_bulk, self.ess_tail).min()
        return bool(self.r_hat.max() <= LARGEST_R_HAT and ess >= SMALLEST_ESS)

    @property
    def warning(self) -> str | None:
        """Returns what is wrong with the draws in one sentence, or None if they have converged."""
        if self.has_converged:
            return None
        ess = np.minimum(self.ess_bulk, self.ess_tail).min()
        return (
            f"After {self.n_draws} draws R-hat is {self.r_hat.max():.3f} and the effective sample size {ess:.0f}; "
            f"expected at most {LARGEST_R_HAT} and at least {SMALLEST_ESS:.0f}."
        )


def diagnose(draws: Float[np.ndarray, "n_chains n_draws n_quantities"], acceptance: float) -> Diagnostics:
    """Returns the diagnostics of all draws after warm-up.

    A quantity that no chain ever moves has no ESS: it is reported as 0, with an infinite R-hat.
    """
    per_quantity = [_diagnose_one(np.ascontiguousarray(draws[:, :, k])) for k in range(draws.shape[2])]
    r_hat, ess_bulk, ess_tail = np.array(per_quantity).T
    return Diagnostics(r_hat, ess_bulk, ess_tail, acceptance, draws.shape[0] * draws.shape[1])


def _diagnose_one(draws: Float[np.ndarray, "n_chains n_draws"]) -> tuple[float, float, float]:
    """Returns R-hat, bulk ESS and tail ESS of one scalar quantity."""
    halves = _split(draws)
    if (halves == halves[:, :1]).all():
        return np.inf, 0.0, 0.0
    flat = halves.ravel()
    order = np.argsort(flat)
    scores = _normal_scores(flat.size)
    ascending = flat[order]
    distances, folded_order = kernels.fold(flat, order, _quantile(ascending, 0.5))
    bulk = kernels.rank_normalise(flat, order, scores).reshape(halves.shape)
    folded = kernels.rank_normalise(distances, folded_order, scores).reshape(halves.shape)
    r_hat = max(kernels.r_hat(bulk), kernels.r_hat(folded))
    # The edges of the tails are those of all draws, an odd middle one included.
    every = ascending if draws.size == flat.size else np.sort(draws, axis=None)
    edges = (_quantile(every, 0.05), _quantile(every, 0.95))
    tail = min(kernels.effective_sample_size((halves <= edge).astype(np.float64)) for edge in edges)
    return r_hat, kernels.effective_sample_size(bulk), tail


def _split(draws: Float[np.ndarray, "n_chains n_draws"]) -> Float[np.ndarray, "twice_n_chains half_n_draws"]:
    """Returns each chain's first and second half as chains; an odd middle draw is left out."""
    half = draws.shape[1] // 2
    return np.ascontiguousarray(np.concatenate([draws[:, :half], draws[:, -half:]]))


def _quantile(ascending: Float[np.ndarray, " n"], level: float) -> float:
    """Returns a quantile of sorted values, interpolated linearly."""
    place = level * (len(ascending) - 1)
    below = int(place)
    above = min(below + 1, len(ascending) - 1)
    return float(ascending[below] + (place - below) * (ascending[above] - ascending[below]))


@lru_cache(maxsize=4)
def _normal_scores(n: int) -> Float[np.ndarray, " twice_n"]:
    """Returns the normal score of every rank 1, 1.5, ..., n of n values (half ranks are ties; Blom's formula)."""
    half_ranks = np.arange(2 * n + 1) / 2.0
    scores: Float[np.ndarray, " twice_n"] = ndtri((half_ranks - 0.375) / (n + 0.25))
    return scores
