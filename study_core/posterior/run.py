"""The posterior after some answers: drawn until the draws meet the diagnostics, M of them kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, ComparisonSet
from study_core.posterior.annealing import learn_from_draws, learn_proposal
from study_core.posterior.diagnostics import Diagnostics, diagnose
from study_core.posterior.evidence import choose_by_evidence
from study_core.posterior.metropolis import Chains, run_chains
from study_core.posterior.prior import Prior
from study_core.posterior.target import Target


@dataclass(frozen=True)
class SamplerSettings:
    """How much to draw.

    Attributes:
        n_chains: Chains with starts of their own.
        n_warmup: Draws of each warm-up stage for each coordinate.
        n_draws: Draws of each chain before the diagnostics are looked at.
        most_draws: Draws of each chain after which an update ends, whatever the diagnostics say.
        n_samples: M, how many draws the acquisition sees.
    """

    n_chains: int
    n_warmup: int
    n_draws: int
    most_draws: int
    n_samples: int


@dataclass(frozen=True)
class Posterior:
    """What the answers say about w and the response parameters.

    Attributes:
        samples: Evenly thinned draws of w, shape `(n_samples, n_features)`.
        parameters: The response model's parameters; row i belongs to `samples[i]`.
        log_densities: Log posterior density of each, up to a constant: the likelihood, times the prior of the
            inferred parameters on the scale on which it is normal; that of w is uniform, or with that of the
            rationality what the people before say. Shape `(n_samples,)`.
        mean: Mean of w over all draws, shape `(n_features,)`.
        diagnostics: Of all draws, not of the thinned ones: of each weight, then of each inferred parameter.
    """

    samples: Float[np.ndarray, "n_samples n_features"]
    parameters: ResponseParameters
    log_densities: Float[np.ndarray, " n_samples"]
    mean: Float[np.ndarray, " n_features"]
    diagnostics: Diagnostics

    def probability_of_a(self, feature_diffs: Float[np.ndarray, "n n_features"]) -> Float[np.ndarray, " n"]:
        """Returns the posterior predictive probability of A for each psi: the mean over the samples."""
        reward_diffs = self.samples @ feature_diffs.T
        return self.parameters.probability_of(Choice.A, reward_diffs).mean(axis=0)


def infer(
    rng: np.random.Generator,
    prior: Prior,
    response: ResponseModel,
    comparisons: ComparisonSet,
    settings: SamplerSettings,
) -> Posterior:
    """Returns p(w, response parameters | answers) as samples; without answers, the prior, drawn by the same chains.

    As long as the diagnostics ask for more, what has been drawn becomes part of the warm-up, and twice as many draws
    are made; `Diagnostics.has_converged` says whether the last ones were enough.
    """
    target = Target(prior, choose_by_evidence(rng, prior, response, comparisons), comparisons)
    proposal = learn_proposal(rng, target, settings.n_warmup, settings.n_chains)
    n_draws = settings.n_draws
    while True:
        chains = run_chains(rng, target, proposal, n_draws)
        diagnostics = _diagnose(target, chains)
        if diagnostics.has_converged or n_draws == settings.most_draws:
            return _summarise(target, chains, diagnostics, settings.n_samples)
        proposal = learn_from_draws(rng, chains.points)
        n_draws = min(2 * n_draws, settings.most_draws)


def _diagnose(target: Target, chains: Chains) -> Diagnostics:
    """Returns the diagnostics of every weight and of every inferred parameter's coordinate."""
    flat = chains.points.reshape(-1, target.n_coordinates)
    quantities = np.hstack([target.weights(flat), flat[:, target.prior.n_coordinates :]])
    return diagnose(quantities.reshape(*chains.points.shape[:2], -1), chains.acceptance)


def _summarise(target: Target, chains: Chains, diagnostics: Diagnostics, n_samples: int) -> Posterior:
    flat = chains.points.reshape(-1, target.n_coordinates)
    kept = flat[np.linspace(0, len(flat) - 1, n_samples).round().astype(np.int64)]
    inferred = kept[:, target.prior.n_coordinates :]
    return Posterior(
        samples=target.weights(kept),
        parameters=target.parameters(kept),
        log_densities=target.log_densities(kept)[1] - 0.5 * (inferred**2).sum(axis=1),
        mean=target.weights(flat).mean(axis=0),
        diagnostics=diagnostics,
    )
