"""What a predictor that learns across people would know of somebody if there were nobody else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.domain import Domain
from study_core.predictors.own_answers import OwnAnswers
from study_core.predictors.predictor import Pairs, PersonModel, Predictor, Training

# What the one person of such a population is called.
_ONE = "one"


@dataclass(frozen=True)
class UnknownPerson:
    """Somebody of whom nothing is known; a `PersonModel`."""

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns a half for each pair."""
        return np.full(len(pairs), 0.5)


class Alone:
    """Another predictor, fitted to each person as if they were all people there are; a `Predictor`.

    All that the other one chooses by its data (scales of features, of weights, lapse rate, networks) comes from that
    person's answers alone. Before the first of them, a half: a linear reward of whatever features, whose weights
    are as likely to be turned around, prefers neither side.

    Attributes:
        name: That of the other predictor, with `-alone` after it.
        predictor: Must learn from a single person, and believe in no sign of a weight before any answer.
    """

    def __init__(self, predictor: Predictor) -> None:
        self.name = f"{predictor.name}-alone"
        self.predictor = predictor

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> OwnAnswers:
        """Fits the other predictor to each person by themselves; somebody may have given no answer."""

        def learn(rng: np.random.Generator, training: Training) -> PersonModel:
            if len(training) == 0:
                return UnknownPerson()
            seed_of_person = int(rng.integers(2**32))
            return self.predictor.fit(seed_of_person, domain, {_ONE: training}).people[_ONE]

        return OwnAnswers.of(self.name, seed, learn, people)
