"""Simulated people: a truth to recover."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.choice import ResponseModel
from study_core.comparison import Choice, Query
from study_core.posterior.prior import Prior
from study_core.streams import stream


@dataclass(frozen=True)
class SimulatedPerson:
    """Someone with known weights who answers by a response model.

    Attributes:
        weights: The true w, shape `(n_features,)`.
        response: How they answer.
    """

    weights: Float[np.ndarray, " n_features"]
    response: ResponseModel

    def choose(self, rng: np.random.Generator, query: Query) -> Choice:
        """Returns an answer, drawn from the response model."""
        reward_diff = np.array([query.feature_diff @ self.weights])
        likely_a = self.response.parameters(1).probability_of(Choice.A, reward_diff)[0]
        return Choice.A if rng.random() < likely_a else Choice.B


def draw_person(seed: int, number: int, prior: Prior, response: ResponseModel) -> SimulatedPerson:
    """Returns the simulated person of that number: weights from the prior."""
    weights = prior.draw(stream(seed, "simulated-weights", number), 1)[0]
    return SimulatedPerson(weights, response)


def alignment(estimate: Float[np.ndarray, " n_features"], truth: Float[np.ndarray, " n_features"]) -> float:
    """Returns the cosine between estimated and true weights (Biyik et al. 2019)."""
    return float(estimate @ truth / (np.linalg.norm(estimate) * np.linalg.norm(truth)))
