"""Simulated people: a truth to recover."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, Query
from study_core.posterior.prior import Prior
from study_core.streams import stream

A_OR_B = (Choice.A, Choice.B)


@dataclass(frozen=True)
class Habits:
    """How somebody departs from the response model that a study assumes.

    Attributes:
        drift_rad: Root mean square of the angle, in radians, by which the direction of w moves from one query to the
            next; 0 for a person of firm taste.
        side_bias: Added to the log-odds of A; positive for somebody drawn to A's side of the screen.
        unsure_rate: Share of queries that they don't answer whatever is shown, by any of the answers that say
            nothing, where the study offers one; in [0, 1].
    """

    drift_rad: float = 0.0
    side_bias: float = 0.0
    unsure_rate: float = 0.0


NO_HABITS = Habits()


@dataclass(frozen=True)
class SimulatedPerson:
    """Someone with known weights who answers by a response model.

    Attributes:
        weights: The true w, now, shape `(n_features,)`.
        parameters: How they answer, one row.
        answers: What the study lets them answer, A and B first.
        habits: What the study's response model doesn't know of.
    """

    weights: Float[np.ndarray, " n_features"]
    parameters: ResponseParameters
    answers: tuple[Choice, ...] = A_OR_B
    habits: Habits = NO_HABITS

    def probabilities(self, query: Query) -> dict[Choice, float]:
        """Returns how likely each offered answer is; together 1.

        A side bias b shifts u = beta (R_A - R_B) to u + b.
        """
        shift = self.habits.side_bias / self.parameters.rationality
        reward_diffs = query.feature_diff @ self.weights + shift
        silent = [choice for choice in self.answers if not choice.is_informative]
        unsure_rate = self.habits.unsure_rate if silent else 0.0
        return {
            choice: (1.0 - unsure_rate) * float(self.parameters.probability_of(choice, reward_diffs)[0])
            if choice.is_informative
            else unsure_rate / len(silent)
            for choice in self.answers
        }

    def choose(self, rng: np.random.Generator, query: Query) -> Choice:
        """Returns an answer, drawn by `probabilities`."""
        probabilities = self.probabilities(query)
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
) -> SimulatedPerson:
    """Returns the simulated person of that number: weights from the prior, the same whatever their habits.

    What the study infers, or chooses by the evidence, is drawn from its prior, too.
    """
    weights = prior.draw(stream(seed, "simulated-weights", number), 1)[0]
    parameters = response.draw_parameters(stream(seed, "simulated-parameters", number), 1)
    return SimulatedPerson(weights, parameters, answers, habits)


def alignment(estimate: Float[np.ndarray, " n_features"], truth: Float[np.ndarray, " n_features"]) -> float:
    """Returns the cosine between estimated and true weights (Biyik et al. 2019)."""
    return float(estimate @ truth / (np.linalg.norm(estimate) * np.linalg.norm(truth)))
