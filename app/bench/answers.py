"""Simulated people's answers about random pairs of locally optimal drives: what posteriors are measured on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.bench.peers.target import LAPSE_RATE, RATIONALITY
from study_core.choice import ResponseModel
from study_core.comparison import Choice, ComparisonSet
from study_core.domain import Domain
from study_core.participants import draw_person
from study_core.posterior.prior import Prior
from study_core.predictors.predictor import Pairs, Training
from study_core.streams import stream
from study_core.trajectory import best_trajectories

RESPONSE = ResponseModel("sigmoid", RATIONALITY, LAPSE_RATE)
_N_DRIVES = 200


@dataclass(frozen=True)
class Answers:
    """What somebody preferred.

    Attributes:
        slates: Features of both drives of each query, the preferred one first, shape `(n, 2, n_features)`.
    """

    slates: Float[np.ndarray, "n 2 n_features"]

    def first(self, n: int) -> Answers:
        """Returns the first n answers."""
        return Answers(self.slates[:n])

    @property
    def comparisons(self) -> ComparisonSet:
        """Returns them as the response model sees them; the preferred drive is A."""
        return ComparisonSet(self.slates[:, 0] - self.slates[:, 1], np.ones(len(self.slates)))


def prior_of(domain: Domain) -> Prior:
    """Returns the prior that every measurement has: with beta given, the length of w says nothing."""
    return Prior("sphere", len(domain.feature_names))


def simulated_answers(domain: Domain, seed: int, number: int, n: int) -> Answers:
    """Returns n answers of the simulated person of that number."""
    states, is_first = _compared(domain, seed, number, n)
    slates = domain.features(states.reshape(-1, *states.shape[2:])).reshape(n, 2, -1)
    return Answers(np.where(is_first[:, None, None], slates, slates[:, ::-1]))


def simulated_training(domain: Domain, seed: int, number: int, n: int) -> Training:
    """Returns the same answers with the drives that they are about; no posterior is stored."""
    states, is_first = _compared(domain, seed, number, n)
    return Training(Pairs(states[:, 0], states[:, 1]), np.where(is_first, 1.0, -1.0))


def _compared(
    domain: Domain, seed: int, number: int, n: int
) -> tuple[Float[np.ndarray, "n 2 n_steps n_states"], Bool[np.ndarray, " n"]]:
    """Returns the drives of each pair, and whether the first was preferred."""
    prior = prior_of(domain)
    person = draw_person(seed, number, prior, RESPONSE)
    rng = stream(seed, "bench-slates", number)
    drives = best_trajectories(rng, domain, prior.draw(rng, _N_DRIVES), 1).controls
    states = domain.rollout(drives)
    features = domain.features(states)
    rows = np.array([rng.choice(_N_DRIVES, 2, replace=False) for _ in range(n)])
    reward_diffs = (features[rows[:, 0]] - features[rows[:, 1]]) @ person.weights
    is_first = rng.random(n) < person.parameters.probability_of(Choice.A, reward_diffs[None])[0]
    return states[rows], is_first
