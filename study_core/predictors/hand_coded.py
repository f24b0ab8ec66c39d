"""What the hand-coded features alone predict: as the study stored it, and with each person's own way of answering."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.special import expit

from study_core.choice import ResponseModel
from study_core.domain import Domain
from study_core.posterior.population import PopulationPrior
from study_core.posterior.prior import Prior
from study_core.posterior.run import Posterior, SamplerSettings, infer
from study_core.predictors.own_answers import OwnAnswers, comparisons, hand_coded_diffs
from study_core.predictors.predictor import Pairs, Training

STORED_RESPONSE = ResponseModel("clipped-linear", 1.0)
"""The response model whose posterior the published study stored, over the ball."""

CALIBRATED_RESPONSE = ResponseModel("sigmoid", "inferred", "inferred")
"""The response model that learns each person's rationality and lapse rate, over the sphere."""

SETTINGS = SamplerSettings(n_chains=4, n_warmup=200, n_draws=750, most_draws=12_000, n_samples=1000)


@dataclass(frozen=True)
class MeanModel:
    """Somebody of known weights who answers by the sigmoid with rationality 1.

    Attributes:
        domain: Whose features the weights are of.
        weights: Posterior mean of w, shape `(n_features,)`.
    """

    domain: Domain
    weights: Float[np.ndarray, " n_features"]

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns sigmoid(w . psi)."""
        return np.asarray(expit(hand_coded_diffs(self.domain, pairs) @ self.weights))


@dataclass(frozen=True)
class PosteriorModel:
    """Somebody known by a posterior of weights and response parameters.

    Attributes:
        domain: Whose features the weights are of.
        posterior: What their answers say.
    """

    domain: Domain
    posterior: Posterior

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns the posterior predictive probability."""
        return self.posterior.probability_of_a(hand_coded_diffs(self.domain, pairs))


class HandCodedStored:
    """The sign of w . psi, w being the posterior mean that the study stored: the paper's hand-coded bars.

    The sign is all that the paper reports. As a probability it is sigmoid(w . psi), rationality 1, which is how the
    study assumed that people answer; that is honest about the study, and hardly moves from a half. Where no mean is
    stored, the posterior is drawn as the study drew its own: clipped-linear with rationality 1 over the ball.
    """

    name = "hand-coded-stored"

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> OwnAnswers:
        """Takes, or draws, each person's posterior mean; without answers, the prior's."""
        return OwnAnswers.of(self.name, seed, partial(_learn_mean, domain=domain), people)


class HandCodedCalibrated:
    """The posterior predictive of a sigmoid whose rationality and lapse rate are inferred with the weights.

    Weights are uniform on the nonnegative sphere, so the rationality is the person's own. Without answers, the prior
    predictive.
    """

    name = "hand-coded-calibrated"

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> OwnAnswers:
        """Draws each person's posterior."""
        return OwnAnswers.of(self.name, seed, partial(learn_posterior, domain=domain), people)


def posterior_mean(
    rng: np.random.Generator, training: Training, domain: Domain
) -> Float[np.ndarray, " n_features"]:
    """Returns the posterior mean of w that the study stored, or would have."""
    if training.stored_mean is not None:
        return training.stored_mean
    prior = Prior("ball", len(domain.feature_names))
    return infer(rng, prior, STORED_RESPONSE, comparisons(domain, training), SETTINGS).mean


def _learn_mean(rng: np.random.Generator, training: Training, domain: Domain) -> MeanModel:
    return MeanModel(domain, posterior_mean(rng, training, domain))


def learn_posterior(
    rng: np.random.Generator, training: Training, domain: Domain, population: PopulationPrior | None = None
) -> PosteriorModel:
    """Returns the calibrated posterior after some answers, or none.

    Args:
        rng: Source of all randomness.
        training: The answers.
        domain: Gives the hand-coded features.
        population: What the people before care for.
    """
    prior = Prior("sphere", len(domain.feature_names), population)
    answers = comparisons(domain, training)
    return PosteriorModel(domain, infer(rng, prior, CALIBRATED_RESPONSE, answers, SETTINGS))
