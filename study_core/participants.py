"""Simulated people: a truth to recover."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, Query
from study_core.domain import Domain
from study_core.errors import UnknownNameError
from study_core.posterior.prior import Prior
from study_core.streams import stream

A_OR_B = (Choice.A, Choice.B)


@dataclass(frozen=True)
class Habits:
    """How somebody departs from the response model that a study assumes.

    Attributes:
        drift_rad: Root mean square of the angle, in radians, by which the direction of w moves from one query to the
            next; 0 for a person of firm taste.
        side_bias: Added to the log-odds of what is in the first position; positive for somebody drawn to that.
        unsure_rate: Share of queries that they don't answer whatever is shown, by any of the answers that say
            nothing, where the study offers one; in [0, 1].
        hidden_feature: One of the domain's rich features that their reward has besides the hand-coded ones; None for
            somebody who cares for nothing else.
        hidden_weight: Its weight, per unit of the feature.
    """

    drift_rad: float = 0.0
    side_bias: float = 0.0
    unsure_rate: float = 0.0
    hidden_feature: str | None = None
    hidden_weight: float = 0.0


NO_HABITS = Habits()


@dataclass(frozen=True)
class HiddenReward:
    """A part of somebody's reward that no hand-coded feature has.

    Attributes:
        domain: Gives the feature.
        feature: Name of one of its rich features.
        weight: Per unit of the feature.
    """

    domain: Domain
    feature: str
    weight: float

    def __post_init__(self) -> None:
        if self.feature not in self.domain.rich_feature_names:
            names = self.domain.rich_feature_names
            raise UnknownNameError(f"rich feature of '{self.domain.id}'", self.feature, names)

    def reward_diff(self, query: Query) -> float:
        """Returns how much A has of it more than B."""
        states = self.domain.rollout(np.stack([query.controls_a, query.controls_b]))
        of_a, of_b = self.domain.rich_features(states)[:, self.domain.rich_feature_names.index(self.feature)]
        return self.weight * float(of_a - of_b)


@dataclass(frozen=True)
class SimulatedPerson:
    """Someone with known weights who answers by a response model.

    Attributes:
        weights: The true w, now, shape `(n_features,)`.
        parameters: How they answer, one row.
        answers: What the study lets them answer, A and B first.
        habits: What the study's response model doesn't know of.
        hidden: What they care for besides, if their habits say so.
    """

    weights: Float[np.ndarray, " n_features"]
    parameters: ResponseParameters
    answers: tuple[Choice, ...] = A_OR_B
    habits: Habits = NO_HABITS
    hidden: HiddenReward | None = None

    def reward_diff(self, query: Query) -> float:
        """Returns by how much they truly prefer A."""
        hidden = 0.0 if self.hidden is None else self.hidden.reward_diff(query)
        return float(query.feature_diff @ self.weights) + hidden

    def probabilities(self, query: Query, first_shown: Choice = Choice.A) -> dict[Choice, float]:
        """Returns how likely each offered answer is; together 1.

        A side bias b shifts u = beta (R_A - R_B) to u + b where A is in the first position, to u - b where B is.
        """
        side = 1.0 if first_shown is Choice.A else -1.0
        shift = side * self.habits.side_bias / self.parameters.rationality
        reward_diffs = self.reward_diff(query) + shift
        silent = [choice for choice in self.answers if not choice.is_informative]
        unsure_rate = self.habits.unsure_rate if silent else 0.0
        return {
            choice: (1.0 - unsure_rate) * float(self.parameters.probability_of(choice, reward_diffs)[0])
            if choice.is_informative
            else unsure_rate / len(silent)
            for choice in self.answers
        }

    def choose(self, rng: np.random.Generator, query: Query, first_shown: Choice = Choice.A) -> Choice:
        """Returns an answer, drawn by `probabilities`."""
        probabilities = self.probabilities(query, first_shown)
        place = np.searchsorted(np.cumsum(list(probabilities.values())), rng.random(), side="right")
        # The sum may fall short of 1 by a rounding.
        return self.answers[min(int(place), len(self.answers) - 1)]

    def drifted(self, rng: np.random.Generator) -> SimulatedPerson:
        """Returns the person one query later: their weights have wandered.

        The direction of w takes one step of an isotropic random walk on the sphere, along a great circle, and is
        reflected where a weight would turn negative; the length stays. A crowd drawn from a uniform prior stays
        distributed like it.
        """
        if self.habits.drift_rad == 0.0:
            return self
        length = np.linalg.norm(self.weights)
        direction = self.weights / length
        step = rng.standard_normal(len(direction))
        step -= (step @ direction) * direction
        step *= self.habits.drift_rad / np.sqrt(len(direction) - 1)
        angle = np.linalg.norm(step)
        moved = np.cos(angle) * direction + np.sin(angle) / angle * step
        return replace(self, weights=length * np.abs(moved))


def draw_person(
    seed: int,
    number: int,
    prior: Prior,
    response: ResponseModel,
    answers: tuple[Choice, ...] = A_OR_B,
    habits: Habits = NO_HABITS,
    domain: Domain | None = None,
) -> SimulatedPerson:
    """Returns the simulated person of that number: weights from the prior, the same whatever their habits.

    What the study infers, or chooses by the evidence, is drawn from its prior, too.

    Args:
        seed: With the number, decides everything about them.
        number: From 1.
        prior: Of the weights.
        response: Of the parameters.
        answers: What the study lets them answer.
        habits: What the response model doesn't know of.
        domain: Whose trajectories they compare; only who has a hidden feature needs it.

    Raises:
        UnknownNameError: The domain has no rich feature of that name.
    """
    weights = prior.draw(stream(seed, "simulated-weights", number), 1)[0]
    parameters = response.draw_parameters(stream(seed, "simulated-parameters", number), 1)
    hidden = None
    if habits.hidden_feature is not None:
        assert domain is not None, "a hidden feature is one of a domain's"
        hidden = HiddenReward(domain, habits.hidden_feature, habits.hidden_weight)
    return SimulatedPerson(weights, parameters, answers, habits, hidden)


def alignment(estimate: Float[np.ndarray, " n_features"], truth: Float[np.ndarray, " n_features"]) -> float:
    """Returns the cosine between estimated and true weights (Biyik et al. 2019)."""
    return float(estimate @ truth / (np.linalg.norm(estimate) * np.linalg.norm(truth)))
