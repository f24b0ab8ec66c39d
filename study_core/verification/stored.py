"""A posterior as it was stored, and what a query was chosen from by it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.choice import PARAMETER_PRIORS, ResponseParameters
from study_core.comparison import ComparisonSet
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior
from study_core.study import Study


@dataclass(frozen=True)
class StoredPosterior:
    """What was kept of a posterior.

    Attributes:
        samples: Draws of w, shape `(n_samples, n_features)`.
        mean: Mean of w over all draws, shape `(n_features,)`.
        parameters: Response parameters of each sample; None where they differed and nobody kept them.
        diagnostics: Of all draws.
    """

    samples: Float[np.ndarray, "n_samples n_features"]
    mean: Float[np.ndarray, " n_features"]
    parameters: ResponseParameters | None
    diagnostics: Diagnostics


def posterior_of(study: Study, comparisons: ComparisonSet, stored: StoredPosterior) -> Posterior | None:
    """Returns what a query was chosen from; None where the response parameters are unknown.

    Args:
        study: The study, with what is known.
        comparisons: The answers before the query, in the features of `study.rewards`.
        stored: What was kept.
    """
    if stored.parameters is None:
        return None
    logs = log_densities(study, comparisons, stored.samples, stored.parameters)
    return Posterior(stored.samples, stored.parameters, logs, stored.mean, stored.diagnostics)


def log_densities(
    study: Study,
    comparisons: ComparisonSet,
    samples: Float[np.ndarray, "n n_features"],
    parameters: ResponseParameters,
) -> Float[np.ndarray, " n"]:
    """Returns the log posterior density of each sample, as `Posterior.log_densities` has it."""
    logs = study.response.log_likelihood(samples, parameters, comparisons)
    for name in study.response.inferred:
        logs = logs - 0.5 * _standardised(parameters, name) ** 2
    population = study.rewards.prior.population
    if population is None:
        return logs
    # Their normal density of u = beta w takes the place of the prior of beta; see `posterior.kernels`.
    utilities = parameters.rationality[:, None] * samples - population.mean
    squared = np.einsum("ni,ij,nj->n", utilities, population.precision, utilities)
    volume = len(population.mean) * np.log(parameters.rationality)
    return logs + 0.5 * _standardised(parameters, "rationality") ** 2 + volume - 0.5 * squared


def _standardised(parameters: ResponseParameters, name: str) -> Float[np.ndarray, " n"]:
    """Returns the coordinates of a response parameter, which are standard normal under its prior."""
    values, prior = getattr(parameters, name), PARAMETER_PRIORS[name]  # type: ignore[index]
    transformed = np.log(values) - (np.log1p(-values) if prior.transform == "logit" else 0.0)
    return (transformed - prior.location) / prior.scale
