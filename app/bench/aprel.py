"""Belief update and information-gain query as APReL does them, written from its description, not from its code.

The belief is a Metropolis chain of single steps: a Gaussian step of w, normalised, kept by its likelihood; of 2,200
steps the first 200 are dropped and every 20th of the rest is a sample. The query is the best of all pairs of a fixed
set of trajectories by the information that its answer is expected to give about w (Biyik, Talati and Sadigh 2022;
the objective is that of Biyik et al. 2019, eq. 9):

    sum over samples w and answers q of  p(q | w) log2( M p(q | w) / sum over w' of p(q | w') )  /  M

Each exists twice. The looped way visits answers, pairs and samples one by one in Python, as APReL does; the vectorised
way is the same algorithm with one numpy call over the answers of a step, or over a whole pair.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from jaxtyping import Float

N_WARMUP, N_SAMPLES, THINNING = 200, 100, 20
N_STEPS = N_WARMUP + N_SAMPLES * THINNING
_PROPOSAL_SD = 0.05

LogLikelihood = Callable[[Float[np.ndarray, " n_features"]], float]


def sample_belief(
    rng: np.random.Generator, n_features: int, log_likelihood: LogLikelihood
) -> Float[np.ndarray, "n_samples n_features"]:
    """Returns samples of w on the nonnegative part of the sphere, where the prior is uniform."""
    weights = np.full(n_features, n_features**-0.5)
    current = log_likelihood(weights)
    samples = []
    for step in range(1, N_STEPS + 1):
        proposal = weights + _PROPOSAL_SD * rng.standard_normal(n_features)
        proposal /= np.linalg.norm(proposal)
        if (proposal >= 0.0).all():
            proposed = log_likelihood(proposal)
            if np.log(rng.random()) < proposed - current:
                weights, current = proposal, proposed
        if step > N_WARMUP and (step - N_WARMUP) % THINNING == 0:
            samples.append(weights)
    return np.array(samples)


def looped_log_likelihood(
    slates: Float[np.ndarray, "n_answers n_choices n_features"], rationality: float, lapse_rate: float
) -> LogLikelihood:
    """Returns log p(answers | w), summed over the answers one by one; the chosen trajectory is first in its slate."""

    def log_likelihood(weights: Float[np.ndarray, " n_features"]) -> float:
        total = 0.0
        for slate in slates:
            total += np.log(_choice_probabilities(slate @ weights, rationality, lapse_rate)[0])
        return float(total)

    return log_likelihood


def vectorised_log_likelihood(
    slates: Float[np.ndarray, "n_answers n_choices n_features"], rationality: float, lapse_rate: float
) -> LogLikelihood:
    """Returns log p(answers | w), all answers in one numpy call; the chosen trajectory is first in its slate."""

    def log_likelihood(weights: Float[np.ndarray, " n_features"]) -> float:
        likely = _choice_probabilities(slates @ weights, rationality, lapse_rate)
        return float(np.log(likely[:, 0]).sum())

    return log_likelihood


def looped_best_pair(
    features: Float[np.ndarray, "n_trajectories n_features"],
    samples: Float[np.ndarray, "n_samples n_features"],
    rationality: float,
    lapse_rate: float,
) -> tuple[int, int]:
    """Returns the pair whose answer is expected to tell most about w, sample by sample."""

    def gain(pair: tuple[int, int]) -> float:
        slate = features[list(pair)]
        likely = [_choice_probabilities(slate @ weights, rationality, lapse_rate) for weights in samples]
        return _information_gain(np.array(likely))

    return max(combinations(range(len(features)), 2), key=gain)


def vectorised_best_pair(
    features: Float[np.ndarray, "n_trajectories n_features"],
    samples: Float[np.ndarray, "n_samples n_features"],
    rationality: float,
    lapse_rate: float,
) -> tuple[int, int]:
    """Returns the pair whose answer is expected to tell most about w, all samples of a pair in one numpy call."""

    def gain(pair: tuple[int, int]) -> float:
        return _information_gain(
            _choice_probabilities(samples @ features[list(pair)].T, rationality, lapse_rate)
        )

    return max(combinations(range(len(features)), 2), key=gain)


def _choice_probabilities(
    rewards: Float[np.ndarray, "*shape n_choices"], rationality: float, lapse_rate: float
) -> Float[np.ndarray, "*shape n_choices"]:
    """Returns how likely each trajectory of a slate is chosen: softmax(beta R), with lapses spread over all of them."""
    utilities = rationality * rewards
    odds = np.exp(utilities - utilities.max(axis=-1, keepdims=True))
    return np.asarray(
        lapse_rate / rewards.shape[-1] + (1.0 - lapse_rate) * odds / odds.sum(axis=-1, keepdims=True)
    )


def _information_gain(probabilities: Float[np.ndarray, "n_samples n_choices"]) -> float:
    """Returns the expected information about w in an answer, in bits."""
    n_samples = len(probabilities)
    surprise = np.log2(n_samples * probabilities / probabilities.sum(axis=0))
    return float((probabilities * surprise).sum() / n_samples)
