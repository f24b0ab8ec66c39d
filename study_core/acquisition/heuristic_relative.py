"""The paper's heuristic with densities that don't vanish, and directions compared instead of weights.

    maximise over i != j    p(w_i) p(w_j) / max_k p(w_k)^2 + mu |w_i/|w_i| - w_j/|w_j||

After a few dozen answers the product of the paper's two unnormalised densities is 0 beside any distance, and the
heuristic asks about the two samples farthest apart whatever the answers said. Measured against the best sample, the
densities keep their say. Directions are what the published code compares (Katz et al. 2021): the length of w only
says how reliably someone answers.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from study_core.acquisition.pairs import Acquisition, RankedWeights, Situation
from study_core.acquisition.sample_pairs import rank_sample_pairs


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedWeights:
    """Returns the best pairs by the relative objective; see `study_core.acquisition.pairs.RankFn`."""
    samples = situation.posterior.samples
    directions = samples / np.linalg.norm(samples, axis=1, keepdims=True)
    logs = situation.posterior.log_densities - situation.posterior.log_densities.max()

    def score(i: Int[np.ndarray, " n"], j: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        apart = np.linalg.norm(directions[i] - directions[j], axis=1)
        return np.exp(logs[i] + logs[j]) + situation.mu * apart

    return rank_sample_pairs(samples, score, n_pairs)


HEURISTIC_RELATIVE = Acquisition("heuristic-relative-1", rank_pairs)
