"""Response models: how likely a person is to choose A, given the two rewards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from scipy.special import expit

from study_core import choice_kernels
from study_core.comparison import Choice, ComparisonSet

ResponseName = Literal["sigmoid", "clipped-linear"]
KERNEL_KINDS: dict[ResponseName, int] = {
    "sigmoid": choice_kernels.SIGMOID,
    "clipped-linear": choice_kernels.CLIPPED_LINEAR,
}


@dataclass(frozen=True)
class ResponseParameters:
    """What a response model's parameters are in each of n rows: one row a posterior sample, or a person.

    A row belongs to the weights in the same row; where both are uncertain they depend on each other.

    Attributes:
        rationality: beta, the inverse temperature, per unit of reward, positive, shape `(n,)`.
        lapse_rate: Share of answers given at random, in [0, 1), shape `(n,)`.
        tie_threshold: eta, in units of beta times reward, shape `(n,)`; 0 where the study offers no "about the
            same".
    """

    rationality: Float[np.ndarray, " n"]
    lapse_rate: Float[np.ndarray, " n"]
    tie_threshold: Float[np.ndarray, " n"]

    @classmethod
    def constant(
        cls, n: int, rationality: float, lapse_rate: float = 0.0, tie_threshold: float = 0.0
    ) -> ResponseParameters:
        """Returns n equal rows."""
        return cls(np.full(n, rationality), np.full(n, lapse_rate), np.full(n, tie_threshold))

    def __len__(self) -> int:
        return len(self.rationality)

    def __getitem__(self, rows: Int[np.ndarray, " n_rows"] | slice) -> ResponseParameters:
        return ResponseParameters(self.rationality[rows], self.lapse_rate[rows], self.tie_threshold[rows])

    def probability_of(
        self, choice: Choice, reward_diffs: Float[np.ndarray, "n *shape"]
    ) -> Float[np.ndarray, "n *shape"]:
        """Returns P(choice | R_A - R_B), given that the answer is one of those that say something.

        With u = beta (R_A - R_B): P(A) = sigmoid(u - eta), P(B) = sigmoid(-u - eta), and "about the same" has the
        rest, sinh(eta) / (cosh(eta) + cosh(u)) (Rao and Kupper 1967, with theta = e^eta). A person who lapses picks
        any of the answers alike: two, or three where there is a tie threshold.

        Args:
            choice: A, B or "about the same".
            reward_diffs: R_A - R_B by the weights of each row, shape `(n, ...)`.

        Raises:
            ValueError: "Can't tell" and "skip" have no probability: the model has no say in when they are given.
        """
        if not choice.is_informative:
            raise ValueError(f"Expected 'a', 'b' or 'same', got '{choice}': the model says nothing about it.")
        rows = (-1,) + (1,) * (reward_diffs.ndim - 1)
        threshold, lapse_rate = self.tie_threshold.reshape(rows), self.lapse_rate.reshape(rows)
        utilities = self.rationality.reshape(rows) * reward_diffs
        has_tie = threshold > 0.0
        if choice is Choice.SAME:
            chosen = expit(utilities - threshold) * expit(-utilities - threshold) * np.expm1(2.0 * threshold)
            lapsed = np.where(has_tie, lapse_rate / 3.0, 0.0)
        else:
            chosen = expit(choice.sign * utilities - threshold)
            lapsed = lapse_rate / np.where(has_tie, 3.0, 2.0)
        return np.asarray(lapsed + (1.0 - lapse_rate) * chosen)


@dataclass(frozen=True)
class ResponseModel:
    """P(answer | w), with a known rationality and lapse rate.

    `sigmoid`: P(A) = lapse / 2 + (1 - lapse) sigmoid(beta (R_A - R_B)) (Katz et al. 2021, eq. 6, which has beta = 1
    for features summed over 50 steps, so beta = 50 for features averaged over them, and no lapse).

    `clipped-linear`: log p = min(beta I (R_A - R_B), 0), the published code's likelihood. It isn't normalised over
    the two answers; normalised, it is the sigmoid, and that is what `probability_of_a` returns.

    Attributes:
        name: Which of the two.
        rationality: beta, the inverse temperature, per unit of reward, positive.
        lapse_rate: Share of answers given at random, in [0, 1); 0 for `clipped-linear`.
    """

    name: ResponseName
    rationality: float
    lapse_rate: float = 0.0

    @property
    def kernel_kind(self) -> int:
        """Returns the model's number in `choice_kernels`."""
        return KERNEL_KINDS[self.name]

    def parameters(self, n: int) -> ResponseParameters:
        """Returns n rows of the parameters."""
        return ResponseParameters.constant(n, self.rationality, self.lapse_rate)

    def probability_of_a(self, reward_diffs: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
        """Returns P(A) for reward differences R_A - R_B of any shape."""
        chosen = expit(self.rationality * reward_diffs)
        return np.asarray(0.5 * self.lapse_rate + (1.0 - self.lapse_rate) * chosen)

    def log_likelihood(
        self, weights: Float[np.ndarray, "n_weights n_features"], comparisons: ComparisonSet
    ) -> Float[np.ndarray, " n_weights"]:
        """Returns log p(all answers | w) for each row of weights; 0 without answers."""
        packed, n_answers = choice_kernels.pack(comparisons.preferred_diffs)
        values: Float[np.ndarray, " n_weights"] = choice_kernels.log_likelihoods(
            self.kernel_kind,
            np.ascontiguousarray(weights),
            packed,
            n_answers,
            self.rationality,
            self.lapse_rate,
        )
        return values
