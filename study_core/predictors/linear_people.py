"""People whose utilities are linear in the same standardised features: how they are learned, and what they answer.

`study_core.predictors.hierarchy` has the model; a predictor chooses the features.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.errors import TooFewAnswersError
from study_core.predictors.hierarchy import Population, learn_person, learn_population
from study_core.predictors.laplace import Gaussian
from study_core.predictors.lapsing import probability
from study_core.predictors.predictor import Pairs, Training

Features = Callable[[Float[np.ndarray, "n n_steps n_states"]], Float[np.ndarray, "n k"]]

# What varies by less than this share of its size is constant up to rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Embedding:
    """Features of trajectories in units of their standard deviation.

    Attributes:
        features: Gives them unscaled, from states.
        inverse_scales: What each is multiplied by, shape `(k,)`; 0 for one that was constant, which so drops out.
    """

    features: Features
    inverse_scales: Float[np.ndarray, " k"]

    def diffs(self, pairs: Pairs) -> Float[np.ndarray, "n k"]:
        """Returns the features of A less those of B, shape `(n, k)`."""
        return (self.features(pairs.states_a) - self.features(pairs.states_b)) * self.inverse_scales

    def signed_diffs(self, training: Training) -> Float[np.ndarray, "n k"]:
        """Returns the features of what was preferred less those of the other, shape `(n, k)`."""
        return ComparedFeatures.of(self.features, training).signed_diffs * self.inverse_scales


@dataclass(frozen=True)
class ComparedFeatures:
    """One person's active answers, as far as features of the trajectories tell them.

    Attributes:
        of_a: Features of each pair's trajectory A, unscaled, shape `(n, k)`.
        of_b: The same of B.
        signs: +1 where A was preferred, -1 where B was, shape `(n,)`.
    """

    of_a: Float[np.ndarray, "n k"]
    of_b: Float[np.ndarray, "n k"]
    signs: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.signs)

    @property
    def signed_diffs(self) -> Float[np.ndarray, "n k"]:
        """Returns the features of what was preferred less those of the other, unscaled, shape `(n, k)`."""
        return self.signs[:, None] * (self.of_a - self.of_b)

    @classmethod
    def of(cls, features: Features, training: Training) -> ComparedFeatures:
        """Returns a person's answers in some features."""
        pairs = training.pairs
        return cls(features(pairs.states_a), features(pairs.states_b), training.signs)


@dataclass(frozen=True)
class LinearPerson:
    """What is known of one person; a `PersonModel`.

    Attributes:
        embedding: Gives the features.
        weights: Posterior of what the person cares for, in the embedding's features.
        lapse_logit: Logit of the lapse rate.
    """

    embedding: Embedding
    weights: Gaussian
    lapse_logit: float

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns how likely the person is to prefer A of each pair, averaged over the posterior."""
        diffs = self.embedding.diffs(pairs)
        variances = ((diffs @ self.weights.covariance) * diffs).sum(axis=1)
        return probability(diffs @ self.weights.mean, variances, self.lapse_logit)


@dataclass(frozen=True)
class LinearPeople:
    """What is known of all; a `Fitted`.

    Attributes:
        embedding: Gives the features.
        population: What people have in common.
        people: By name.
    """

    embedding: Embedding
    population: Population
    people: Mapping[str, LinearPerson]

    def with_person(self, seed: int, training: Training) -> LinearPerson:
        """Returns what is known of somebody new; nothing about it is random."""
        weights = learn_person(self.population, self.embedding.signed_diffs(training))
        return LinearPerson(self.embedding, weights, self.population.lapse_logit)


def learn_people(features: Features, people: Mapping[str, Training]) -> LinearPeople:
    """Learns from everyone's answers; the same bits whatever the order of the people.

    Args:
        features: Of trajectories, in any units; one that doesn't vary in what people compared drops out.
        people: Active answers by person; somebody may have given none.

    Raises:
        TooFewAnswersError: Nobody has given an answer.
    """
    names = sorted(people)
    compared = [ComparedFeatures.of(features, people[name]) for name in names]
    require_answers(compared)
    scales = inverse_scales(
        np.concatenate([*(one.of_a for one in compared), *(one.of_b for one in compared)])
    )
    population, beliefs = learn_population([one.signed_diffs * scales for one in compared])
    embedding = Embedding(features, scales)
    known = {
        name: LinearPerson(embedding, weights, population.lapse_logit)
        for name, weights in zip(names, beliefs, strict=True)
    }
    return LinearPeople(embedding, population, known)


def states_compared(trainings: Sequence[Training]) -> Float[np.ndarray, "n n_steps n_states"]:
    """Returns all trajectories that people have compared: every A in the order of people and answers, then every B.

    Raises:
        TooFewAnswersError: Nobody has given an answer.
    """
    require_answers(trainings)
    pairs = [training.pairs for training in trainings]
    return np.concatenate([*(pair.states_a for pair in pairs), *(pair.states_b for pair in pairs)])


def require_answers(people: Sequence[Training] | Sequence[ComparedFeatures]) -> None:
    """Checks that somebody has given an answer.

    Raises:
        TooFewAnswersError: Nobody has.
    """
    if not any(len(person) for person in people):
        raise TooFewAnswersError("Expected an answer of at least one person, got none. Ask somebody first.")


def inverse_scales(values: Float[np.ndarray, "n k"]) -> Float[np.ndarray, " k"]:
    """Returns 1 over the standard deviation of each column; 0 for one that is constant up to rounding."""
    deviations = values.std(axis=0)
    varies = deviations > _ROUNDING * np.abs(values).max(axis=0)
    return np.divide(1.0, deviations, out=np.zeros_like(deviations), where=varies)
