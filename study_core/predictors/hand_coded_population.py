"""The hand-coded features, each person's own way of answering, and what the people before care for.

What people have in common is learned by the hierarchical model (`study_core.predictors.hierarchy`) over the hand-coded
features, which says of somebody new that w_std ~ N(mean of w_0, its covariance + s_1^2 I), in standardised features. In
the features' own units that is a normal distribution of u = beta w, where a session's posterior may start.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from study_core.choice import PARAMETER_PRIORS
from study_core.domain import Domain
from study_core.posterior.population import PopulationPrior
from study_core.predictors.hand_coded import PosteriorModel, learn_posterior
from study_core.predictors.linear_people import ComparedFeatures, learn_weights
from study_core.predictors.own_answers import OwnAnswers
from study_core.predictors.predictor import Training
from study_core.streams import stream

VERSION = "hand-coded-hierarchy-1"


class HandCodedPopulation:
    """A `Predictor`: the posterior that a session has that started from the people before.

    Everybody, fitted or new, starts from what the others care for: nobody's answers count twice. Who is alone starts
    from the prior of `hand-coded-calibrated`.

    Attributes:
        name: `hand-coded-population`.
    """

    name = "hand-coded-population"

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> OwnAnswers:
        """Learns what people have in common, once without each of them, and draws each person's posterior."""
        compared = {name: ComparedFeatures.of(domain.features, training) for name, training in people.items()}

        def without(name: str) -> PosteriorModel:
            population = learn_population_prior({other: compared[other] for other in people if other != name})
            return learn_posterior(stream(seed, self.name, "person", name), people[name], domain, population)

        learn = partial(learn_posterior, domain=domain, population=learn_population_prior(compared))
        return OwnAnswers(self.name, learn, {name: without(name) for name in people})


def learn_population_prior(people: Mapping[str, ComparedFeatures]) -> PopulationPrior | None:
    """Returns what these people say about the utilities of the next; None where nobody has preferred anything.

    A feature that was the same in all that was compared has taught nothing. Its utility has mean 0 and the variance of
    the uniform prior at the rationality that is usual there, and goes with no other's.

    Args:
        people: Active answers in the hand-coded features, by person; their order doesn't matter.
    """
    if not any(len(compared) for compared in people.values()):
        return None
    learned = learn_weights(people)
    shared, scales = learned.population.shared, learned.inverse_scales
    n_features = len(scales)
    covariance = shared.covariance + learned.population.personal_scale**2 * np.eye(n_features)
    covariance *= np.outer(scales, scales)
    unknown = np.flatnonzero(scales == 0.0)
    covariance[unknown, unknown] = PARAMETER_PRIORS["rationality"].value(np.zeros(1))[0] ** 2 / n_features
    return PopulationPrior(shared.mean * scales, covariance)
