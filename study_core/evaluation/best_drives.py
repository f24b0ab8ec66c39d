"""The best trajectory for any reward of its states, learned ones too (the paper's Fig. 9), and how people's differ."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Float, Int

from study_core import lbfgs
from study_core.differences import central_differences
from study_core.distinctness import visible_difference, visible_paths
from study_core.domain import Domain
from study_core.evaluation.learned import RewardFn
from study_core.streams import stream

N_CANDIDATES = 10_000
_N_STARTS = 10
_MAX_EVALUATIONS = 200


def draw_candidates(seed: int, domain: Domain) -> Float[np.ndarray, "n_candidates n_controls"]:
    """Returns random controls, uniform within their bounds; the same for everybody."""
    shape = (N_CANDIDATES, len(domain.control_lower))
    return stream(seed, "candidates").uniform(domain.control_lower, domain.control_upper, shape)


def best_of(
    domain: Domain, candidates: Float[np.ndarray, "n_candidates n_controls"], reward: RewardFn
) -> Float[np.ndarray, " n_controls"]:
    """Returns the best candidate, as the paper looked for it."""
    return candidates[int(np.argmax(reward(domain.rollout(candidates))))]


def optimise(
    domain: Domain, candidates: Float[np.ndarray, "n_candidates n_controls"], reward: RewardFn
) -> Float[np.ndarray, " n_controls"]:
    """Returns where the climbs from the best candidates end highest.

    The slopes are central differences: a learned feature needs no gradient of its own in the controls.
    """
    best = np.argsort(-reward(domain.rollout(candidates)), kind="stable")[:_N_STARTS]

    def evaluate(
        points: Float[np.ndarray, "n n_controls"], rows: Int[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_controls"]]:
        return central_differences(lambda controls: reward(domain.rollout(controls)), points)

    points, values, _, _ = lbfgs.climb(
        evaluate, candidates[best], domain.control_lower, domain.control_upper, _MAX_EVALUATIONS
    )
    return points[int(np.argmax(values))]


def diversity(
    domain: Domain, drives: Float[np.ndarray, "n_people n_controls"]
) -> Float[np.ndarray, " n_pairs"]:
    """Returns how far apart any two people's drives look, in body lengths, one value for each pair of people."""
    paths = visible_paths(domain, drives)
    first, second = np.array(list(combinations(range(len(drives)), 2))).T
    return visible_difference(paths[first], paths[second])
