"""What was compared and what was preferred."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float


class Choice(StrEnum):
    """What a person answers about a query's two trajectories, in the query's own order.

    A and B prefer one; SAME finds them about the same. UNSURE (can't tell) and SKIP are answers too, but say nothing
    about the person's weights: they never enter a likelihood.
    """

    A = "a"
    B = "b"
    SAME = "same"
    UNSURE = "unsure"
    SKIP = "skip"

    @property
    def is_informative(self) -> bool:
        """Returns whether the answer says something about the weights."""
        return self in (Choice.A, Choice.B, Choice.SAME)

    @property
    def sign(self) -> float:
        """Returns I: +1 for A, -1 for B (Katz et al. 2021, eq. 4), 0 for the rest, which prefer neither."""
        return {Choice.A: 1.0, Choice.B: -1.0}.get(self, 0.0)


@dataclass(frozen=True)
class Query:
    """Two trajectories to choose between.

    Attributes:
        controls_a: Controls of trajectory A, shape `(n_controls,)`.
        controls_b: Controls of trajectory B, shape `(n_controls,)`.
        features_a: Phi(A), shape `(n_features,)`.
        features_b: Phi(B), shape `(n_features,)`.
    """

    controls_a: Float[np.ndarray, " n_controls"]
    controls_b: Float[np.ndarray, " n_controls"]
    features_a: Float[np.ndarray, " n_features"]
    features_b: Float[np.ndarray, " n_features"]

    @property
    def feature_diff(self) -> Float[np.ndarray, " n_features"]:
        """Returns psi = Phi(A) - Phi(B)."""
        return self.features_a - self.features_b


@dataclass(frozen=True)
class ComparisonSet:
    """Answered queries, as the response model sees them.

    Attributes:
        feature_diffs: psi of each query, shape `(n_answers, n_features)`.
        signs: I of each answer: +1 where A was preferred, -1 where B was, 0 where they are about the same, shape
            `(n_answers,)`.
    """

    feature_diffs: Float[np.ndarray, "n_answers n_features"]
    signs: Float[np.ndarray, " n_answers"]

    @classmethod
    def empty(cls, n_features: int) -> ComparisonSet:
        """Returns the set of a person who has not answered yet."""
        return cls(np.empty((0, n_features)), np.empty(0))

    def __len__(self) -> int:
        return len(self.signs)

    @property
    def preferred_diffs(self) -> Float[np.ndarray, "n_answers n_features"]:
        """Returns I psi: Phi(preferred) - Phi(other), and 0 where they are about the same."""
        return self.feature_diffs * self.signs[:, None]

    def append(self, query: Query, choice: Choice) -> ComparisonSet:
        """Returns the set with one more answer, or itself if the answer says nothing."""
        if not choice.is_informative:
            return self
        return ComparisonSet(
            np.vstack([self.feature_diffs, query.feature_diff]), np.append(self.signs, choice.sign)
        )
