"""People who resemble each other: how much they do, learned from all of them, and what that says of somebody new.

    w_0k ~ N(0, s_0^2),    w_uk ~ N(w_0k, s_1^2),    P(answer) = lapse / 2 + (1 - lapse) sigmoid(w_u . difference)

    log s_0 ~ N(log 0.3, 1),    log s_1 ~ N(log 0.15, 1),    logit(lapse) ~ N(-3, 1)

s_0, s_1 and the lapse rate are where their posterior density is highest, with the weights integrated out by Laplace's
approximation (its gradient: Rasmussen and Williams 2006, section 5.5.1). Whoever comes later is a population of one,
whose shared weights are believed to be what the others' answers say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from study_core.predictors.laplace import (
    Gaussian,
    Posterior,
    Prior,
    Weights,
    approximate,
    sums_over_answers,
)

STANDARDISED = (float(np.log(0.3)), float(np.log(0.15)))
"""Prior means of log s_0 and log s_1 for many features, each in units of its standard deviation."""

# Of the lapse rate; each of the three hyperparameters has a normal prior of standard deviation 1.
_EXPECTED_LAPSE_LOGIT = -3.0
# Hyperparameters are good when the log evidence has a smaller slope than this in each.
_FLAT = 1e-3
# Standard deviations from the prior mean beyond which nothing is looked for.
_FARTHEST = 6.0


@dataclass(frozen=True)
class Population:
    """What people have in common.

    Attributes:
        shared: Posterior of w_0, the taste of nobody in particular.
        shared_scale: s_0.
        personal_scale: s_1, by how much each weight differs from person to person.
        lapse_logit: Logit of the lapse rate.
        log_evidence: Log probability of all answers less that of tossing a coin, at these scales.
        has_converged: Whether scales and weights are at the top; if not, they are the best found.
    """

    shared: Gaussian
    shared_scale: float
    personal_scale: float
    lapse_logit: float
    log_evidence: float
    has_converged: bool


def learn_population(
    signed_diffs: Sequence[Float[np.ndarray, "_ k"]], expected_log_scales: tuple[float, float] = STANDARDISED
) -> tuple[Population, tuple[Gaussian, ...]]:
    """Learns from everybody's answers at once.

    Args:
        signed_diffs: For each person, features of what they preferred less those of the other, shape `(n, k)`; features
            that vary by about 1.
        expected_log_scales: Prior means of log s_0 and log s_1.

    Returns:
        What is common to all, and the posterior of each person's own weights.
    """
    padded = _padded(signed_diffs)
    expected = np.array([*expected_log_scales, _EXPECTED_LAPSE_LOGIT])
    start = None

    def cost(hyperparameters: Float[np.ndarray, " 3"]) -> tuple[float, Float[np.ndarray, " 3"]]:
        nonlocal start
        value, gradient, posterior = log_evidence(hyperparameters, padded, start)
        start = posterior.mode
        offset = hyperparameters - expected
        return offset @ offset / 2 - value, offset - gradient

    found = minimize(
        cost,
        expected,
        jac=True,
        method="L-BFGS-B",
        bounds=[(mean - _FARTHEST, mean + _FARTHEST) for mean in expected],
        options={"gtol": _FLAT},
    )
    value, _, posterior = log_evidence(found.x, padded, start)
    population = Population(
        shared=posterior.of_shared(),
        shared_scale=float(np.exp(found.x[0])),
        personal_scale=float(np.exp(found.x[1])),
        lapse_logit=float(found.x[2]),
        log_evidence=value,
        has_converged=bool(found.success) and posterior.has_converged,
    )
    return population, tuple(posterior.of_person(u) for u in range(len(padded)))


def learn_person(population: Population, signed_diffs: Float[np.ndarray, "n k"]) -> Gaussian:
    """Returns the posterior of the weights of somebody who was not among the population.

    Args:
        population: What the others have in common.
        signed_diffs: As in `learn_population`, of their own answers; there may be none.
    """
    prior = Prior(
        population.shared.mean,
        np.linalg.inv(population.shared.covariance),
        population.personal_scale**-2,
        population.lapse_logit,
    )
    return approximate(prior, signed_diffs[None]).of_person(0)


def log_evidence(
    hyperparameters: Float[np.ndarray, " 3"],
    signed_diffs: Float[np.ndarray, "n_people n k"],
    start: Weights | None = None,
) -> tuple[float, Float[np.ndarray, " 3"], Posterior]:
    """Returns Laplace's log evidence less that of tossing a coin, its gradient, and the posterior of the weights.

    Args:
        hyperparameters: log s_0, log s_1, logit(lapse).
        signed_diffs: Shape `(n_people, n, k)`, padded with rows of zeros.
        start: Where to start to climb to the mode.
    """
    n_people, _, k = signed_diffs.shape
    precision, personal_precision = np.exp(-2.0 * hyperparameters[:2])
    prior = Prior(np.zeros(k), precision * np.eye(k), float(personal_precision), float(hyperparameters[2]))
    posterior = approximate(prior, signed_diffs, start)
    log_determinant_of_prior = k * (np.log(precision) + n_people * np.log(personal_precision))
    half = (log_determinant_of_prior - posterior.covariances.log_determinant) / 2
    gradient = _gradient_of_evidence(precision, personal_precision, signed_diffs, posterior)
    return float(posterior.log_density + half), gradient, posterior


def _gradient_of_evidence(
    precision: float,
    personal_precision: float,
    signed_diffs: Float[np.ndarray, "n_people n k"],
    posterior: Posterior,
) -> Float[np.ndarray, " 3"]:
    """Each entry has the derivative at a fixed mode, and what comes of the mode's moving, through its pull."""
    mode, likelihood, covariances = posterior.mode, posterior.likelihood, posterior.covariances
    deviations = mode.personal - mode.shared
    of_weights = covariances.personal
    variances = ((signed_diffs @ of_weights) * signed_diffs).sum(axis=2)
    # How the log determinant would fall if the mode moved, carried back to whatever moves it.
    slope = Weights(
        np.zeros_like(mode.shared),
        sums_over_answers(signed_diffs, -variances * likelihood.slope_of_information) / 2,
    )
    pull = posterior.inverse_hessian.times(slope)
    of_shared = (
        precision * (mode.shared @ mode.shared + np.trace(covariances.shared))
        - mode.shared.size
        + 2 * precision * pull.shared @ mode.shared
    )
    of_personal = (
        personal_precision
        * ((deviations**2).sum() + np.trace(covariances.deviations, axis1=1, axis2=2).sum())
        - deviations.size
        + 2 * personal_precision * ((pull.personal - pull.shared) * deviations).sum()
    )
    of_lapse = (
        likelihood.lapse_slope.sum()
        - (variances * likelihood.lapse_slope_of_information).sum() / 2
        + (pull.personal * sums_over_answers(signed_diffs, likelihood.lapse_slope_of_slope)).sum()
    )
    return np.array([of_shared, of_personal, of_lapse])


def _padded(signed_diffs: Sequence[Float[np.ndarray, "_ k"]]) -> Float[np.ndarray, "n_people n k"]:
    """Fills up with rows of zeros, which say nothing."""
    most = max(len(diffs) for diffs in signed_diffs)
    return np.stack([np.pad(diffs, ((0, most - len(diffs)), (0, 0))) for diffs in signed_diffs])
