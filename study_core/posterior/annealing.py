"""Warm-up: from the prior to the posterior in stages, each learning where to look for the next.

Adaptive importance sampling (Cappé et al. 2008), on the way from the prior, whose draws are exact, to the prior times
the likelihood to a power that grows to 1 (Neal 2001). Each stage draws points, weights them, and fits a mixture of
Student's t distributions to them, which proposes the next stage's points. Its draws are independent, so nothing burns
in, and a posterior of several modes or a narrow one is approached from all sides. The last mixture keeps a share of the
one before the power reached 1, which is wider: a region that no point of the last stage fell into is proposed still.

What is learned is used unchanged from then on: as the proposal of the chains, and to estimate the evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from study_core.posterior.mixture import Mixture, fit
from study_core.posterior.target import Target

# The power grows until the weights are worth this share of the points, and by half at least.
_SMALLEST_WORTH = 0.2
_SMALLEST_GROWTH = 1.5
_BISECTIONS = 12
# At the power 1, the mixture is fitted again until its own weights are worth this share, some times at most.
_SUFFICIENT_WORTH = 0.5
_MOST_REFINEMENTS = 3
_PRIOR_DRAWS = 1000
_COMPONENTS_ON_THE_WAY, _ROUNDS_ON_THE_WAY = 4, 2
_COMPONENTS, _ROUNDS = 8, 4
_WIDE_SHARE = 0.2
# Of the chains' draws, so many for each coordinate are enough to fit the components to.
_DRAWS_TO_LEARN_FROM, _ROUNDS_WITH_DRAWS = 1000, 8


@dataclass(frozen=True)
class Proposal:
    """What the warm-up has learned.

    Attributes:
        mixture: Close to the posterior.
        covariance: Of the posterior, roughly, shape `(n, n)`.
        starts: Where the chains start, shape `(n_starts, n)`: distinct points of the stage at which the power reached
            1, whose proposals are wider than the posterior; or where they have come to.
    """

    mixture: Mixture
    covariance: Float[np.ndarray, "n n"]
    starts: Float[np.ndarray, "n_starts n"]


def learn_proposal(rng: np.random.Generator, target: Target, n_points: int, n_starts: int) -> Proposal:
    """Returns a proposal for the posterior.

    Args:
        rng: Source of all randomness.
        target: What is sampled.
        n_points: Draws of each stage for each coordinate.
        n_starts: How many starts to return.
    """
    n_points *= target.n_coordinates
    stage = _Stage.of_prior(rng, target, max(_PRIOR_DRAWS, n_points))
    wide, power = Mixture.standard(target.n_coordinates), 0.0
    while power < 1.0:
        power = _next_power(stage, power)
        weights = stage.weights(power)
        starts = stage.points[_distinct(rng, weights, n_starts)]
        mixture = fit(rng, stage.points, weights, _COMPONENTS_ON_THE_WAY, _ROUNDS_ON_THE_WAY)
        if power < 1.0:
            wide, stage = mixture, _Stage.of_mixture(rng, target, mixture, n_points)
    for _ in range(_MOST_REFINEMENTS):
        stage = _Stage.of_mixture(rng, target, mixture.with_share(wide, _WIDE_SHARE), n_points)
        weights = stage.weights(1.0)
        mixture = fit(rng, stage.points, weights, _COMPONENTS, _ROUNDS)
        if weights.sum() >= _SUFFICIENT_WORTH * n_points:
            break
    return Proposal(mixture.with_share(wide, _WIDE_SHARE), _covariance(stage.points, weights), starts)


def learn_from_draws(rng: np.random.Generator, draws: Float[np.ndarray, "n_chains n_draws n"]) -> Proposal:
    """Returns a proposal for the posterior from draws that have not converged; they are of no other use.

    Where the chains stayed too long the mixture was too thin; that is where they have most draws now.
    """
    n = draws.shape[2]
    flat = draws.reshape(-1, n)
    kept = flat[:: 1 + (len(flat) - 1) // (n * _DRAWS_TO_LEARN_FROM)]
    equal = np.ones(len(kept))
    mixture = fit(rng, kept, equal, _COMPONENTS, _ROUNDS_WITH_DRAWS)
    return Proposal(mixture, _covariance(kept, equal), draws[:, -1].copy())


def _covariance(
    points: Float[np.ndarray, "n_points n"], weights: Float[np.ndarray, " n_points"]
) -> Float[np.ndarray, "n n"]:
    return np.atleast_2d(np.cov(points, rowvar=False, aweights=weights, ddof=0))


@dataclass(frozen=True)
class _Stage:
    """Points drawn from a proposal, with all that their weights at any power depend on."""

    points: Float[np.ndarray, "n_points n"]
    log_ratios: Float[np.ndarray, " n_points"]
    """Log prior density over proposal density."""
    log_likelihoods: Float[np.ndarray, " n_points"]

    @classmethod
    def of_prior(cls, rng: np.random.Generator, target: Target, n_points: int) -> _Stage:
        points = target.draw_prior(rng, n_points)
        return cls(points, np.zeros(n_points), target.log_densities(points)[1])

    @classmethod
    def of_mixture(cls, rng: np.random.Generator, target: Target, mixture: Mixture, n_points: int) -> _Stage:
        points = mixture.draw(rng, n_points)
        log_priors, log_likelihoods = target.log_densities(points)
        return cls(points, log_priors - mixture.log_density(points), log_likelihoods)

    def weights(self, power: float) -> Float[np.ndarray, " n_points"]:
        """Returns importance weights adding up to the number of points that they are worth.

        The largest are cut to sqrt(n) times the mean (Ionides 2008), so that no point alone decides a fit.
        """
        weights = _ratios(self.log_ratios + power * self.log_likelihoods)
        weights = np.minimum(weights, weights.mean() * np.sqrt(len(weights)))
        return weights * (_worth(weights) / weights.sum())


def _ratios(log_weights: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Returns weights of which the largest is 1."""
    return np.exp(log_weights - log_weights.max())


def _worth(weights: Float[np.ndarray, " n"]) -> float:
    """Returns how many equally weighted points these are worth (Kong 1992)."""
    return float(weights.sum() ** 2 / (weights @ weights))


def _next_power(stage: _Stage, power: float) -> float:
    """Returns the largest power at which the points are worth enough, at most 1 and at least half again as large."""
    enough = _SMALLEST_WORTH * len(stage.points)

    def is_enough(candidate: float) -> bool:
        return _worth(_ratios(stage.log_ratios + candidate * stage.log_likelihoods)) >= enough

    if is_enough(1.0):
        return 1.0
    low, high = power, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_enough(middle) else (low, middle)
    # Where people before were much alike, even a small share of what they say leaves few of the prior's draws.
    while low == 0.0:
        low, high = (0.5 * high, high) if is_enough(0.5 * high) else (0.0, 0.5 * high)
    return min(1.0, max(low, _SMALLEST_GROWTH * power))


def _distinct(
    rng: np.random.Generator, weights: Float[np.ndarray, " n"], n_rows: int
) -> Int[np.ndarray, " n_rows"]:
    """Returns different rows, drawn in proportion to their weights without replacement (by the Gumbel trick)."""
    with np.errstate(divide="ignore"):
        scores = np.log(weights) + rng.gumbel(size=len(weights))
    return np.argsort(-scores, kind="stable")[:n_rows]
