"""Response models: how likely a person is to give each answer, given the two rewards."""

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

Setting = float | Literal["inferred", "evidence"]
"""A parameter's number; or `inferred` together with the weights; or chosen on a grid by the `evidence`."""

ParameterName = Literal["rationality", "lapse_rate", "tie_threshold"]


@dataclass(frozen=True)
class ParameterPrior:
    """The prior of a parameter that isn't fixed: normal after a transform.

    Attributes:
        transform: `log` for what is positive, `logit` for a share.
        location: Mean after the transform.
        scale: Standard deviation after the transform.
    """

    transform: Literal["log", "logit"]
    location: float
    scale: float

    def value(self, standardised: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Returns the parameter from its coordinate, which is standard normal under the prior."""
        transformed = self.location + self.scale * standardised
        return np.asarray(np.exp(transformed) if self.transform == "log" else expit(transformed))

    def log_density(self, value: float) -> float:
        """Returns the log-density after the transform, up to a constant."""
        transformed = np.log(value) - (np.log1p(-value) if self.transform == "logit" else 0.0)
        return float(-0.5 * ((transformed - self.location) / self.scale) ** 2)


PARAMETER_PRIORS: dict[ParameterName, ParameterPrior] = {
    "rationality": ParameterPrior("log", float(np.log(50.0)), 1.5),
    "lapse_rate": ParameterPrior("logit", -3.0, 1.0),
    "tie_threshold": ParameterPrior("log", 0.0, 1.0),
}
"""Priors of the parameters that aren't fixed.

The rationality's is centred on the paper's own (1 for sums over 50 steps, 50 for means); 95 % of it is 2.6 to 950,
from answers that hardly depend on the rewards to answers that follow the smallest difference. The lapse rate's has
the median 0.05 and 95 % from 0.007 to 0.26. The tie threshold's has 95 % from 0.14 to 7.1: two equally good
trajectories are called "about the same" with probability tanh(eta / 2), 0.07 to 0.998.
"""


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
            # 1 - e^(-2 eta), not e^(2 eta) - 1, which overflows: the e^(2 eta) goes into one of the sigmoids.
            shared = expit(threshold - np.abs(utilities)) * expit(threshold + np.abs(utilities))
            chosen = shared * -np.expm1(-2.0 * threshold)
            lapsed = np.where(has_tie, lapse_rate / 3.0, 0.0)
        else:
            chosen = expit(choice.sign * utilities - threshold)
            lapsed = lapse_rate / np.where(has_tie, 3.0, 2.0)
        return np.asarray(lapsed + (1.0 - lapse_rate) * chosen)


@dataclass(frozen=True)
class ResponseModel:
    """P(answer | w), with parameters that are known, inferred with the weights, or chosen by the evidence.

    `sigmoid`: P(A) = lapse / 2 + (1 - lapse) sigmoid(beta (R_A - R_B)) (Katz et al. 2021, eq. 6, which has beta = 1
    for features summed over 50 steps, so beta = 50 for features averaged over them, and no lapse). With "about the
    same" among the answers, see `ResponseParameters.probability_of`.

    `clipped-linear`: log p = min(beta I (R_A - R_B), 0), the published code's likelihood. It isn't normalised over
    the two answers, so its parameters can't be learned; normalised, it is the sigmoid, and that is what predictions
    use.

    The answers know beta and the length of w by their product alone. On the ball both are free: the prior decides
    how the product is shared, and a posterior of beta there must not be read as the person's rationality. On the
    sphere the length is 1 and beta means what it says.

    Attributes:
        name: Which of the two.
        rationality: beta, the inverse temperature, per unit of reward, positive.
        lapse_rate: Share of answers given at random, in [0, 1); 0 for `clipped-linear`.
        tie_threshold: eta; 0 where "about the same" isn't among the answers.
    """

    name: ResponseName
    rationality: Setting
    lapse_rate: Setting = 0.0
    tie_threshold: Setting = 0.0

    @property
    def kernel_kind(self) -> int:
        """Returns the model's number in `choice_kernels`."""
        return KERNEL_KINDS[self.name]

    @property
    def settings(self) -> dict[ParameterName, Setting]:
        """Returns how each parameter is set, in the order of `ResponseParameters`."""
        return {
            "rationality": self.rationality,
            "lapse_rate": self.lapse_rate,
            "tie_threshold": self.tie_threshold,
        }

    @property
    def inferred(self) -> tuple[ParameterName, ...]:
        """Returns the parameters that are inferred together with the weights."""
        return tuple(name for name, setting in self.settings.items() if setting == "inferred")

    @property
    def chosen_by_evidence(self) -> tuple[ParameterName, ...]:
        """Returns the parameters that are chosen by the evidence before anything is inferred."""
        return tuple(name for name, setting in self.settings.items() if setting == "evidence")

    def with_fixed(self, values: dict[ParameterName, float]) -> ResponseModel:
        """Returns the model with some parameters fixed."""
        return ResponseModel(self.name, **{**self.settings, **values})

    def parameters(
        self, n: int, inferred: dict[ParameterName, Float[np.ndarray, " n"]] | None = None
    ) -> ResponseParameters:
        """Returns n rows of the parameters: constants, and what was inferred.

        Raises:
            ValueError: A parameter is neither fixed nor among the inferred ones.
        """
        given = inferred or {}
        columns = {}
        for name, setting in self.settings.items():
            if isinstance(setting, str) and name not in given:
                raise ValueError(f"Expected a number for {name}, which is '{setting}'. Infer it first.")
            columns[name] = given[name] if isinstance(setting, str) else np.full(n, float(setting))
        return ResponseParameters(**columns)

    def draw_parameters(self, rng: np.random.Generator, n: int) -> ResponseParameters:
        """Returns n rows: constants where fixed, draws from the prior where not."""
        free = {
            name: PARAMETER_PRIORS[name].value(rng.standard_normal(n))
            for name in (*self.inferred, *self.chosen_by_evidence)
        }
        return self.parameters(n, free)

    def log_likelihood(
        self,
        weights: Float[np.ndarray, "n n_features"],
        parameters: ResponseParameters,
        comparisons: ComparisonSet,
    ) -> Float[np.ndarray, " n"]:
        """Returns log p(all answers | w, parameters) for each row; 0 without answers."""
        values: Float[np.ndarray, " n"] = choice_kernels.log_likelihoods(
            self.kernel_kind,
            np.ascontiguousarray(weights),
            parameters.rationality,
            parameters.lapse_rate,
            parameters.tie_threshold,
            choice_kernels.pack(comparisons.feature_diffs, comparisons.signs),
        )
        return values
