"""What predictors have in common that learn each person from that person's own answers alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.comparison import ComparisonSet
from study_core.domain import Domain
from study_core.predictors.predictor import Pairs, PersonModel, Training
from study_core.streams import stream

Learn = Callable[[np.random.Generator, Training], PersonModel]


@dataclass(frozen=True)
class OwnAnswers:
    """People who are each known by what they answered themselves; the contract of `predictor.Fitted`.

    Attributes:
        name: The predictor's.
        learn: Returns what is known about a person from some answers of theirs, or none.
        people: What is known about each of those it has learned from.
    """

    name: str
    learn: Learn
    people: Mapping[str, PersonModel]

    @classmethod
    def of(
        cls, name: str, seed: int, learn: Learn, people: Mapping[str, Training], n_threads: int = 1
    ) -> OwnAnswers:
        """Learns each person, with a random stream of their own; so the number of threads changes nothing."""
        rngs = [stream(seed, name, "person", person) for person in people]
        with ThreadPoolExecutor(n_threads) as pool:
            models = pool.map(learn, rngs, people.values())
            return cls(name, learn, dict(zip(people, models, strict=True)))

    def with_person(self, seed: int, training: Training) -> PersonModel:
        """Returns what is known about somebody from their own answers."""
        return self.learn(stream(seed, self.name, "new-person"), training)


def hand_coded_diffs(domain: Domain, pairs: Pairs) -> Float[np.ndarray, "n n_features"]:
    """Returns psi = Phi(A) - Phi(B) of each pair."""
    return domain.features(pairs.states_a) - domain.features(pairs.states_b)


def comparisons(domain: Domain, training: Training) -> ComparisonSet:
    """Returns the answers as the response models see them."""
    return ComparisonSet(hand_coded_diffs(domain, training.pairs), training.signs)
