"""The evidence p(answers | model), and the response parameters that it favours.

The weights and the inferred parameters are integrated out by importance sampling from the mixture that the warm-up
has fitted to the posterior:

    p(answers) = E_q [prior(x) p(answers | x) / q(x)],    x ~ q

which is unbiased, and whose ratios are bounded in practice, because the mixture's tails are wider than the
posterior's.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from study_core.choice import PARAMETER_PRIORS, ParameterName, ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior.annealing import learn_proposal
from study_core.posterior.prior import Prior
from study_core.posterior.target import Target

# Evenly spaced in what a person may be like: each rationality about doubles the last.
GRID: dict[ParameterName, tuple[float, ...]] = {
    "rationality": (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0),
    "lapse_rate": (0.01, 0.02, 0.05, 0.1, 0.2),
}
_WARMUP_DRAWS = 200
_DRAWS = 2000


@dataclass(frozen=True)
class Evidence:
    """An estimate of log p(answers | model).

    Attributes:
        log_evidence: The estimate.
        standard_error: Its Monte Carlo standard error.
    """

    log_evidence: float
    standard_error: float


def log_evidence(
    rng: np.random.Generator,
    prior: Prior,
    response: ResponseModel,
    comparisons: ComparisonSet,
    n_draws: int = _DRAWS,
) -> Evidence:
    """Returns the evidence of a response model whose parameters are fixed or inferred.

    It is 0 without answers; where the people before are known it has a constant in it, the same for every model.
    """
    target = Target(prior, response, comparisons)
    mixture = learn_proposal(rng, target, _WARMUP_DRAWS, n_starts=1).mixture
    points = mixture.draw(rng, n_draws)
    log_priors, log_likelihoods = target.log_densities(points)
    log_ratios = log_priors + log_likelihoods - mixture.log_density(points)
    largest = float(log_ratios.max())
    ratios = np.exp(log_ratios - largest)
    mean = float(ratios.mean())
    return Evidence(
        log_evidence=largest + math.log(mean) - target.log_normaliser,
        standard_error=float(ratios.std(ddof=1)) / (mean * math.sqrt(n_draws)),
    )


def choose_by_evidence(
    rng: np.random.Generator, prior: Prior, response: ResponseModel, comparisons: ComparisonSet
) -> ResponseModel:
    """Returns the model with what the evidence is to choose fixed at the best point of `GRID`.

    The best has the largest product of evidence and prior density, the prior being that of an inferred parameter
    (`PARAMETER_PRIORS`): so a few answers can't choose an extreme. A model with nothing to choose comes back as it is.
    """
    names = response.chosen_by_evidence
    if not names:
        return response
    candidates = [
        dict(zip(names, values, strict=True)) for values in itertools.product(*(GRID[name] for name in names))
    ]

    def score(candidate: dict[ParameterName, float]) -> float:
        evidence = log_evidence(rng, prior, response.with_fixed(candidate), comparisons)
        log_prior = math.fsum(PARAMETER_PRIORS[name].log_density(value) for name, value in candidate.items())
        return evidence.log_evidence + log_prior

    return response.with_fixed(max(candidates, key=score))
