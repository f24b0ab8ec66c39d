"""Response models: how likely a person is to choose A, given the two rewards."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.special import expit

from study_core import choice_kernels
from study_core.comparison import ComparisonSet

ResponseName = Literal["sigmoid", "clipped-linear"]
KERNEL_KINDS: dict[ResponseName, int] = {
    "sigmoid": choice_kernels.SIGMOID,
    "clipped-linear": choice_kernels.CLIPPED_LINEAR,
}


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

    def predicted_probability_of_a(
        self,
        samples: Float[np.ndarray, "n_samples n_features"],
        feature_diff: Float[np.ndarray, " n_features"],
    ) -> float:
        """Returns P(A) averaged over posterior samples of w."""
        return float(math.fsum(self.probability_of_a(samples @ feature_diff)) / len(samples))
