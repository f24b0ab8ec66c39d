"""The posterior by brute force: exact draws from the prior, weighted by a likelihood that is written here."""

import math
from dataclasses import dataclass
from functools import lru_cache

import arviz
import numpy as np
from scipy.special import expit

from study_core.comparison import ComparisonSet
from tests.study_core import references

N_POINTS = 200_000
TRUTH = np.array([0.6, 0.1, 0.7, 0.35, 0.2, 0.5, 0.3])


@dataclass(frozen=True)
class Case:
    """A prior and a response model, in plain numbers. A parameter of None is inferred."""

    support: str
    d: int = 4
    model: str = "sigmoid"
    rationality: float | None = 30.0
    lapse_rate: float | None = 0.0
    tie_threshold: float | None = 0.0

    @property
    def has_ties(self):
        return self.tie_threshold != 0.0


def answers(case, n):
    """Answers of somebody in particular to random pairs; a third of them ties where there are any."""
    rng = np.random.default_rng(100 + n)
    diffs = rng.normal(0.0, 0.1, (n, case.d))
    rationality, lapse_rate = case.rationality or 60.0, 0.1 if case.lapse_rate is None else case.lapse_rate
    utilities = rationality * diffs @ TRUTH[: case.d]
    signs = np.where(rng.random(n) < expit(utilities), 1.0, -1.0)
    if case.has_ties:
        signs[np.abs(utilities) < 1.0] = 0.0
    lapses = rng.random(n) < lapse_rate
    signs[lapses] = rng.choice([-1.0, 0.0, 1.0] if case.has_ties else [-1.0, 1.0], lapses.sum())
    return ComparisonSet(diffs, signs)


def drawn_or_fixed(value, drawn, n):
    return drawn if value is None else np.full(n, value)


def prior_parameters(case, rng, n):
    """Rationality, lapse rate and tie threshold, each of n rows; the priors as they are documented."""
    drawn = (
        50.0 * np.exp(1.5 * rng.standard_normal(n)),
        1 / (1 + np.exp(3.0 - rng.standard_normal(n))),
        np.exp(rng.standard_normal(n)),
    )
    given = (case.rationality, case.lapse_rate, case.tie_threshold)
    return [drawn_or_fixed(value, column, n) for value, column in zip(given, drawn, strict=True)]


@lru_cache(maxsize=3)
def prior_points(case):
    rng = np.random.default_rng(77)
    weights = references.prior_draws(rng, case.support, N_POINTS, case.d)
    return weights, prior_parameters(case, rng, N_POINTS)


def log_likelihoods(case, weights, parameters, comparisons):
    if case.model == "clipped-linear":
        utilities = parameters[0][:, None] * (weights @ comparisons.preferred_diffs.T)
        return np.minimum(utilities, 0.0).sum(axis=1)
    return references.log_likelihoods(comparisons.feature_diffs, comparisons.signs, weights, *parameters)


def functions_of(weights, parameters):
    """What is compared: first and second moments, the length, tails, an ordering, and the response parameters."""
    pairs = np.triu_indices(weights.shape[1])
    beta, lapse_rate, tie_threshold = parameters
    return np.column_stack(
        [
            weights,
            weights[:, pairs[0]] * weights[:, pairs[1]],
            np.sqrt((weights**2).sum(axis=1)),
            weights[:, 0] > 0.6,
            weights[:, 1] < 0.1,
            weights[:, 0] > weights[:, 1],
            np.log(beta),
            np.log(beta) ** 2,
            np.log(beta) * weights[:, 0],
            lapse_rate,
            lapse_rate > 0.1,
            tie_threshold,
        ]
    ).astype(float)


def weighted(case, comparisons):
    """Brute-force draws with their weights in pieces that fit in memory: values, weights."""
    weights, parameters = prior_points(case)
    totals = np.concatenate(
        [
            log_likelihoods(case, weights[part], [column[part] for column in parameters], comparisons)
            for part in (slice(start, start + 20_000) for start in range(0, N_POINTS, 20_000))
        ]
    )
    return functions_of(weights, parameters), totals


def estimate(case, comparisons):
    """Mean of each function and its standard error."""
    values, totals = weighted(case, comparisons)
    shares = np.exp(totals - totals.max())
    assert shares.sum() ** 2 / (shares**2).sum() > 400, "too few brute-force draws to say anything"
    return references.standard_error_of_weighted_mean(values, shares)


def log_evidence(case, comparisons):
    """log p(answers) and its standard error."""
    totals = weighted(case, comparisons)[1]
    ratios = np.exp(totals - totals.max())
    error = ratios.std() / (ratios.mean() * math.sqrt(len(ratios)))
    return totals.max() + math.log(ratios.mean()), error


def estimate_of_chains(weights, parameters):
    """Mean of each function over chains `(n_chains, n_draws, ...)` and its standard error, by arviz's ESS."""
    n_chains, n_draws, d = weights.shape
    values = functions_of(weights.reshape(-1, d), parameters)
    spreads = values.std(axis=0)
    sizes = np.array(
        [
            float(arviz.ess(column.reshape(n_chains, n_draws), method="mean")) if spread > 1e-9 else np.inf
            for column, spread in zip(values.T, spreads, strict=True)
        ]
    )
    assert sizes.min() > 500, "too few draws to say anything"
    return values.mean(axis=0), spreads / np.sqrt(sizes)


def largest_z(first, second):
    """The largest difference of two sets of means, in standard errors; what hardly ever happens is no difference."""
    (means, errors), (other_means, other_errors) = first, second
    return float((np.abs(means - other_means) / (np.sqrt(errors**2 + other_errors**2) + 1e-5)).max())
