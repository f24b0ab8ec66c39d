"""The contract of every predictor: learn from people's active answers, then say how likely each is to prefer what.

Nothing here ever holds an answer to a common test query: those are `study_core.evaluation`'s, which asks fitted
predictors for probabilities and doesn't hand them what came.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from study_core.domain import Domain


@dataclass(frozen=True)
class Pairs:
    """Pairs of trajectories, whether anybody has compared them or not.

    Attributes:
        states_a: States after each step of each pair's trajectory A, shape `(n, n_steps, n_states)`.
        states_b: The same of B.
    """

    states_a: Float[np.ndarray, "n n_steps n_states"]
    states_b: Float[np.ndarray, "n n_steps n_states"]

    def __len__(self) -> int:
        return len(self.states_a)

    def __getitem__(self, rows: slice | np.ndarray) -> Pairs:
        return Pairs(self.states_a[rows], self.states_b[rows])


@dataclass(frozen=True)
class Training:
    """What one person's active answers taught.

    Attributes:
        pairs: What was compared, in the order it was asked; only answers that prefer one of the two are here.
        signs: +1 where A was preferred, -1 where B was, shape `(n,)`.
        stored_mean: Mean of the last posterior of w that the study kept, shape `(n_features,)`;
            None where it kept none.
    """

    pairs: Pairs
    signs: Float[np.ndarray, " n"]
    stored_mean: Float[np.ndarray, " n_features"] | None = None

    def __len__(self) -> int:
        return len(self.signs)

    def first(self, n: int) -> Training:
        """Returns what was known after n answers, before any posterior was stored."""
        return Training(self.pairs[:n], self.signs[:n])


@runtime_checkable
class PersonModel(Protocol):
    """What a predictor knows about one person."""

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns how likely the person is to prefer A of each pair, shape `(n,)`, within (0, 1)."""
        ...


@runtime_checkable
class Fitted(Protocol):
    """A predictor that has learned from some people."""

    @property
    def people(self) -> Mapping[str, PersonModel]:
        """Returns what it knows about each of them, by the names they were given."""
        ...

    def with_person(self, seed: int, training: Training) -> PersonModel:
        """Returns what it knows about somebody who was not among them, from few answers of their own or none."""
        ...


@runtime_checkable
class Predictor(Protocol):
    """A way to predict answers."""

    @property
    def name(self) -> str:
        """Returns what it is called in reports."""
        ...

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> Fitted:
        """Learns from everyone's active answers.

        Args:
            seed: Names every random stream, together with the predictor's and the person's name.
            domain: Whose trajectories are compared.
            people: Active answers by person; the order doesn't matter.

        Raises:
            TooFewAnswersError: Somebody has given fewer answers than the predictor can learn from.
        """
        ...
