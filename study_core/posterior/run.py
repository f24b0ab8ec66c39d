"""The posterior after some answers: all draws diagnosed, M of them kept."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, ComparisonSet
from study_core.posterior.diagnostics import Diagnostics, diagnose
from study_core.posterior.metropolis import run_chains
from study_core.posterior.prior import Prior


@dataclass(frozen=True)
class SamplerSettings:
    """How much to draw.

    Attributes:
        n_chains: Independent chains.
        n_warmup: Steps of each chain that only adapt the proposal.
        n_draws: Steps of each chain that are kept and diagnosed.
        n_samples: M, how many draws the acquisition sees.
    """

    n_chains: int
    n_warmup: int
    n_draws: int
    n_samples: int


@dataclass(frozen=True)
class Posterior:
    """What the answers say about w.

    Attributes:
        samples: Evenly thinned draws, shape `(n_samples, n_features)`.
        parameters: The response model's parameters; row i belongs to `samples[i]`.
        log_likelihoods: log p(answers | sample) of each, shape `(n_samples,)`.
        mean: Mean of all draws, shape `(n_features,)`.
        diagnostics: Of all draws, not of the thinned ones.
    """

    samples: Float[np.ndarray, "n_samples n_features"]
    parameters: ResponseParameters
    log_likelihoods: Float[np.ndarray, " n_samples"]
    mean: Float[np.ndarray, " n_features"]
    diagnostics: Diagnostics

    def predicted_probability(self, choice: Choice, feature_diff: Float[np.ndarray, " n_features"]) -> float:
        """Returns the probability of an answer to a query, averaged over the samples."""
        probabilities = self.parameters.probability_of(choice, self.samples @ feature_diff)
        return float(math.fsum(probabilities) / len(probabilities))


def infer(
    rng: np.random.Generator,
    prior: Prior,
    response: ResponseModel,
    comparisons: ComparisonSet,
    settings: SamplerSettings,
) -> Posterior:
    """Returns p(w | answers) as samples; without answers, the prior, drawn by the same chains."""
    chains = run_chains(
        rng, prior, response, comparisons, settings.n_chains, settings.n_warmup, settings.n_draws
    )
    flat = chains.weights.reshape(-1, prior.n_features)
    kept = np.linspace(0, len(flat) - 1, settings.n_samples).round().astype(np.int64)
    return Posterior(
        samples=flat[kept],
        parameters=response.parameters(settings.n_samples),
        log_likelihoods=chains.log_likelihoods.ravel()[kept],
        mean=flat.mean(axis=0),
        diagnostics=diagnose(chains.weights, chains.acceptance),
    )
