"""The paper's heuristic: the pair of samples that is likely and far apart.

    maximise over i != j    p(w_i) p(w_j) + mu |w_i - w_j|

p is the unnormalised posterior density, likelihood times a prior density of 1 (Katz et al. 2021, Sec. II-B). The
product is taken as the exponential of a sum of logarithms that is never positive: it can't overflow, and where it
underflows it is smaller than any difference of distances. The published code multiplied the two *log*-likelihoods,
which prefers unlikely samples and is undefined before the first answer. Here every density is then 1, and the first
query asks about the two samples that are farthest apart.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from study_core.acquisition.pairs import Acquisition, RankedWeights, Situation
from study_core.acquisition.sample_pairs import rank_sample_pairs


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedWeights:
    """Returns the best pairs by the paper's objective; see `study_core.acquisition.pairs.RankFn`."""
    samples, logs = situation.posterior.samples, situation.posterior.log_densities

    def score(i: Int[np.ndarray, " n"], j: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        apart = np.linalg.norm(samples[i] - samples[j], axis=1)
        return np.exp(logs[i] + logs[j]) + situation.mu * apart

    return rank_sample_pairs(samples, score, n_pairs)


HEURISTIC = Acquisition("heuristic-1", rank_pairs)
