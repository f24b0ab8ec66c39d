"""The hand-coded features, each person's own way of answering, and what the people before care for.

What people have in common is learned by the hierarchical model (`study_core.predictors.hierarchy`) over the hand-coded
features, which says of somebody new that u ~ N(mean of w_0, its covariance + s_1^2 I). That is a normal distribution of
u = beta w, where a session's posterior may start.

The features keep their own units, and u that of the study's own prior: beta / sqrt(d), beta being its usual value. Both
scales are expected to be 1 in it. So people before who have said little leave a prior as wide as the one that they
replace. (In units of what people compared, questions that were hard to answer would make everybody look indifferent.)
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from study_core.choice import PARAMETER_PRIORS
from study_core.domain import Domain
from study_core.posterior.population import PopulationPrior
from study_core.predictors.hand_coded import PosteriorModel, learn_posterior
from study_core.predictors.hierarchy import learn_population
from study_core.predictors.linear_people import ComparedFeatures
from study_core.predictors.own_answers import OwnAnswers
from study_core.predictors.predictor import Training
from study_core.streams import stream

VERSION = "hand-coded-hierarchy-2"


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

    Args:
        people: Active answers in the hand-coded features, by person; their order doesn't matter.
    """
    if not any(len(compared) for compared in people.values()):
        return None
    compared = [people[name] for name in sorted(people)]
    n_features = compared[0].of_a.shape[1]
    unit = float(PARAMETER_PRIORS["rationality"].value(np.zeros(1))[0]) / np.sqrt(n_features)
    population, _ = learn_population([unit * one.signed_diffs for one in compared], (0.0, 0.0))
    covariance = population.shared.covariance + population.personal_scale**2 * np.eye(n_features)
    return PopulationPrior(unit * population.shared.mean, unit**2 * covariance)
