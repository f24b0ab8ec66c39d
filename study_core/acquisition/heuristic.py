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

from study_core.acquisition.pairs import RankedPairs
from study_core.posterior.run import Posterior

VERSION = "heuristic-1"


def rank_pairs(rng: np.random.Generator, posterior: Posterior, mu: float, n_pairs: int) -> RankedPairs:
    """Returns the best pairs by the paper's objective; see `study_core.acquisition.pairs.Acquisition`."""
    first, second = np.triu_indices(len(posterior.samples), k=1)
    likely = np.exp(posterior.log_likelihoods[first] + posterior.log_likelihoods[second])
    apart = np.linalg.norm(posterior.samples[first] - posterior.samples[second], axis=1)
    scores = likely + mu * apart
    best = np.argsort(-scores, kind="stable")[:n_pairs]
    return RankedPairs(np.column_stack([first[best], second[best]]), scores[best])
