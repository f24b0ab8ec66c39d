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
from study_core.predictors.linear_people import learn_people
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
        known = {name: self._without(seed, domain, people, name) for name in people}
        learn = partial(learn_posterior, domain=domain, population=learn_population_prior(domain, people))
        return OwnAnswers(self.name, learn, known)

    def _without(
        self, seed: int, domain: Domain, people: Mapping[str, Training], name: str
    ) -> PosteriorModel:
        others = {other: training for other, training in people.items() if other != name}
        population = learn_population_prior(domain, others)
        return learn_posterior(stream(seed, self.name, "person", name), people[name], domain, population)


def learn_population_prior(domain: Domain, people: Mapping[str, Training]) -> PopulationPrior | None:
    """Returns what these people say about the utilities of the next; None where nobody has preferred anything.

    A feature that was the same in all that was compared has taught nothing. Its utility has mean 0 and the variance of
    the uniform prior at the rationality that is usual there, and goes with no other's.

    Args:
        domain: Gives the hand-coded features.
        people: Active answers by person; their order doesn't matter.
    """
    if not any(len(training) for training in people.values()):
        return None
    fitted = learn_people(domain.features, people)
    shared, scales = fitted.population.shared, fitted.embedding.inverse_scales
    n_features = len(scales)
    covariance = shared.covariance + fitted.population.personal_scale**2 * np.eye(n_features)
    covariance *= np.outer(scales, scales)
    unknown = np.flatnonzero(scales == 0.0)
    covariance[unknown, unknown] = PARAMETER_PRIORS["rationality"].value(np.zeros(1))[0] ** 2 / n_features
    return PopulationPrior(shared.mean * scales, covariance)
