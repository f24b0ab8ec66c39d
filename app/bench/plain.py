"""The next query as one would write it down from the paper: every loop in Python, one number at a time.

It does the same work as `app.continuation` with the same numbers of steps, pairs and starts, in code that is neither
tuned nor slowed on purpose: a Metropolis chain over the answers one by one, all pairs of samples, SciPy's L-BFGS-B
from one start after the other with finite differences over a loop of the dynamics (Katz et al. 2021, Sec. II).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from app.continuation import clip_digests
from study_core.comparison import Choice, ComparisonSet, Query
from study_core.study import Study

N_STEPS = 15_000
N_WARMUP = 1_500
_PROPOSAL_SD = 0.05

_DT_S = 0.1
_STEPS_PER_BLOCK = 10
_N_BLOCKS = 5
_ROBOT = (0.0, -0.3, math.pi / 2, 0.4)
_HUMAN = (0.17, 0.0, math.pi / 2, 0.41)
_HUMAN_CONTROLS = (0.0, 0.41, 1.0, 0.41, -1.0, 0.41, 0.0, 0.533, 0.0, 0.533)
_LANES = (-0.17, 0.0, 0.17)

State = tuple[float, float, float, float]


@dataclass(frozen=True)
class PlainQuery:
    """What came out, and how long each part took.

    Attributes:
        draws: Every step of the chain after warm-up, shape `(n_draws, n_features)`.
        pair: The two weight vectors chosen, shape `(2, n_features)`.
        starts: Where the optimiser began, shape `(2, n_starts, n_controls)`.
        rewards: The best reward found for each of the two.
        milliseconds: Time by part; `next_query` is all of it.
    """

    draws: Float[np.ndarray, "n_draws n_features"]
    pair: Float[np.ndarray, "2 n_features"]
    starts: Float[np.ndarray, "2 n_starts n_controls"]
    rewards: tuple[float, float]
    milliseconds: dict[str, float]


def next_query(rng: np.random.Generator, study: Study, comparisons: ComparisonSet) -> PlainQuery:
    """Computes posterior, pair, two trajectories and clips.

    Args:
        rng: Source of all randomness.
        study: With the `driving-v1` domain, a sigmoid without lapses and a prior on the ball.
        comparisons: The answers so far.
    """
    began = time.perf_counter()
    diffs: list[list[float]] = comparisons.preferred_diffs.tolist()
    chain, log_likelihoods = metropolis(rng, diffs, float(study.response.parameters(1).rationality[0]))
    sampled = time.perf_counter()
    kept = [
        round(i * (len(chain) - 1) / (study.sampler.n_samples - 1)) for i in range(study.sampler.n_samples)
    ]
    first, second = best_pair(
        [chain[i] for i in kept], [log_likelihoods[i] for i in kept], study.file.acquisition.mu
    )
    pair = [chain[kept[first]], chain[kept[second]]]
    n_starts = study.file.trajectory.starts
    assert n_starts is not None, "the paper's search is from random starts"
    starts = rng.uniform(-1.0, 1.0, (2, n_starts, 2 * _N_BLOCKS))
    drives = [best_drive(weights, rows) for weights, rows in zip(pair, starts, strict=True)]
    driven = time.perf_counter()
    (controls_a, reward_a), (controls_b, reward_b) = drives
    query = Query(controls_a, controls_b, np.array(features(controls_a)), np.array(features(controls_b)))
    clip_digests(study.domain, query, Choice.A)
    ended = time.perf_counter()
    milliseconds = {
        "next_query": 1e3 * (ended - began),
        "posterior": 1e3 * (sampled - began),
        "pair_and_trajectories": 1e3 * (driven - sampled),
        "clips": 1e3 * (ended - driven),
    }
    return PlainQuery(np.array(chain), np.array(pair), starts, (reward_a, reward_b), milliseconds)


def metropolis(
    rng: np.random.Generator, diffs: Sequence[Sequence[float]], rationality: float
) -> tuple[list[list[float]], list[float]]:
    """Walks `N_STEPS` steps with one fixed proposal; returns w and its log-likelihood at each step after warm-up."""
    weights = [0.4, 0.4, 0.4, 0.4]
    current = log_likelihood(weights, diffs, rationality)
    chain, log_likelihoods = [], []
    for step in range(N_STEPS):
        proposal = [weight + rng.normal(0.0, _PROPOSAL_SD) for weight in weights]
        if is_in_the_prior(proposal):
            proposed = log_likelihood(proposal, diffs, rationality)
            if rng.random() < math.exp(min(0.0, proposed - current)):
                weights, current = proposal, proposed
        if step >= N_WARMUP:
            chain.append(weights)
            log_likelihoods.append(current)
    return chain, log_likelihoods


def is_in_the_prior(weights: Sequence[float]) -> bool:
    """Returns whether w >= 0 and |w| <= 1."""
    return min(weights) >= 0.0 and sum(weight * weight for weight in weights) <= 1.0


def log_likelihood(weights: Sequence[float], diffs: Sequence[Sequence[float]], rationality: float) -> float:
    """Returns the sum over answers of log sigmoid(beta w . (Phi(preferred) - Phi(other)))."""
    total = 0.0
    for diff in diffs:
        reward = 0.0
        for weight, value in zip(weights, diff, strict=True):
            reward += weight * value
        total -= math.log(1.0 + math.exp(-rationality * reward))
    return total


def best_pair(
    samples: Sequence[Sequence[float]], log_likelihoods: Sequence[float], mu: float
) -> tuple[int, int]:
    """Returns i < j that maximise p(w_i) p(w_j) + mu |w_i - w_j|."""
    best, best_score = (0, 1), -math.inf
    for i in range(len(samples)):
        for j in range(i + 1, len(samples)):
            likely = math.exp(log_likelihoods[i] + log_likelihoods[j])
            score = likely + mu * math.dist(samples[i], samples[j])
            if score > best_score:
                best, best_score = (i, j), score
    return best


def best_drive(
    weights: Sequence[float], starts: Float[np.ndarray, "n_starts n_controls"]
) -> tuple[Float[np.ndarray, " n_controls"], float]:
    """Returns the best controls found from any start, and their reward."""

    def loss(controls: Float[np.ndarray, " n_controls"]) -> float:
        return -sum(weight * value for weight, value in zip(weights, features(controls), strict=True))

    bounds = [(-1.0, 1.0)] * starts.shape[1]
    results = [minimize(loss, start, method="L-BFGS-B", bounds=bounds) for start in starts]
    best = min(results, key=lambda result: float(result.fun))
    return np.asarray(best.x), -float(best.fun)


def features(controls: Sequence[float] | Float[np.ndarray, " n_controls"]) -> list[float]:
    """Returns lane, speed, heading and collision of a drive, each averaged over its steps."""
    lane = speed = heading = collision = 0.0
    path = drive(_ROBOT, controls)
    for (x, y, theta, v), (other_x, other_y, _, _) in zip(path, _HUMAN_PATH, strict=True):
        lane += math.exp(-30.0 * min((x - centre) ** 2 for centre in _LANES))
        speed -= (v - 1.0) ** 2
        heading += math.sin(theta)
        collision -= math.exp(-(7.0 * (x - other_x) ** 2 + 3.0 * (y - other_y) ** 2))
    return [total / len(path) for total in (lane, speed, heading, collision)]


def drive(start: State, controls: Sequence[float] | Float[np.ndarray, " n_controls"]) -> list[State]:
    """Returns [x, y, theta, v] after each step."""
    x, y, theta, v = start
    path = []
    for block in range(_N_BLOCKS):
        steer, gas = float(controls[2 * block]), float(controls[2 * block + 1])
        for _ in range(_STEPS_PER_BLOCK):
            x, y, theta, v = (
                x + _DT_S * v * math.cos(theta),
                y + _DT_S * v * math.sin(theta),
                theta + _DT_S * v * steer,
                v + _DT_S * (gas - v),
            )
            path.append((x, y, theta, v))
    return path


_HUMAN_PATH = drive(_HUMAN, _HUMAN_CONTROLS)
