"""Adaptive Metropolis (Haario et al. 2001): warm-up learns the proposal, sampling leaves it alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.choice import ResponseModel
from study_core.choice_kernels import pack
from study_core.comparison import ComparisonSet
from study_core.posterior import kernels
from study_core.posterior.prior import Prior

VERSION = "adaptive-metropolis-1"

# Candidates from the prior among which the chains' starts are drawn by their likelihood.
_N_CANDIDATES = 512
_N_FOR_COVARIANCE = 64


@dataclass(frozen=True)
class Chains:
    """Draws after warm-up.

    Attributes:
        weights: w at every step of every chain, shape `(n_chains, n_draws, n_features)`.
        log_likelihoods: log p(answers | w) at each, shape `(n_chains, n_draws)`.
        acceptance: Share of proposals accepted while sampling.
    """

    weights: Float[np.ndarray, "n_chains n_draws n_features"]
    log_likelihoods: Float[np.ndarray, "n_chains n_draws"]
    acceptance: float


def run_chains(
    rng: np.random.Generator,
    prior: Prior,
    response: ResponseModel,
    comparisons: ComparisonSet,
    n_chains: int,
    n_warmup: int,
    n_draws: int,
) -> Chains:
    """Draws from p(w | answers).

    Args:
        rng: Source of all randomness.
        prior: Prior over w.
        response: Response model.
        comparisons: The answers so far; none is well defined and gives the prior.
        n_chains: Chains, in lockstep.
        n_warmup: Steps of each chain that only adapt the proposal.
        n_draws: Steps of each chain that are kept.
    """
    target = (
        prior.kernel_support,
        response.kernel_kind,
        *pack(comparisons.preferred_diffs),
        response.rationality,
        response.lapse_rate,
    )
    points, covariance = _starts(rng, prior, response, comparisons, n_chains)
    log_densities = _log_densities(prior, response, comparisons, points)
    factor = kernels.adapt(
        target, points, log_densities, covariance, *_variates(rng, n_warmup, n_chains, prior.n_coordinates)
    )
    draws, draw_log_densities, acceptance = kernels.sample(
        target, points, log_densities, factor, *_variates(rng, n_draws, n_chains, prior.n_coordinates)
    )
    flat = draws.reshape(-1, prior.n_coordinates)
    log_likelihoods = draw_log_densities - prior.log_density(flat).reshape(draw_log_densities.shape)
    weights = prior.weights(flat).reshape(n_chains, n_draws, prior.n_features)
    return Chains(weights, log_likelihoods, float(acceptance))


def _variates(
    rng: np.random.Generator, n_steps: int, n_chains: int, n_coordinates: int
) -> tuple[Float[np.ndarray, "n_steps n_chains n_coordinates"], Float[np.ndarray, "n_steps n_chains"]]:
    normals = rng.standard_normal((n_steps, n_chains, n_coordinates))
    return normals, rng.standard_exponential((n_steps, n_chains))


def _starts(
    rng: np.random.Generator,
    prior: Prior,
    response: ResponseModel,
    comparisons: ComparisonSet,
    n_chains: int,
) -> tuple[Float[np.ndarray, "n_chains n_coordinates"], Float[np.ndarray, "n_coordinates n_coordinates"]]:
    """Returns distinct starts drawn from the prior in proportion to their likelihood, and a first covariance.

    Drawing without replacement by the Gumbel trick keeps the starts apart even where one candidate dominates.
    """
    candidates = prior.draw(rng, _N_CANDIDATES)
    scores = response.log_likelihood(candidates, comparisons) + rng.gumbel(size=_N_CANDIDATES)
    best = np.argsort(-scores, kind="stable")[:_N_FOR_COVARIANCE]
    coordinates = np.ascontiguousarray(prior.coordinates(candidates[best]))
    return coordinates[:n_chains].copy(), np.cov(coordinates, rowvar=False)


def _log_densities(
    prior: Prior,
    response: ResponseModel,
    comparisons: ComparisonSet,
    points: Float[np.ndarray, "n_chains n_coordinates"],
) -> Float[np.ndarray, " n_chains"]:
    return prior.log_density(points) + response.log_likelihood(prior.weights(points), comparisons)
