"""Compiled choice of warm starts."""

import numpy as np
from numba import njit

from study_core.distinctness_kernels import looks_new


@njit(cache=True)
def warm_starts(features, paths, weights, n_starts, least_difference):
    """Returns rows of the drives with the highest w . Phi that all look different, shape `(n_weights, n_starts)`.

    Where fewer drives look different, the best one fills the rest.
    """
    chosen = np.empty((weights.shape[0], n_starts), dtype=np.int64)
    for i in range(weights.shape[0]):
        rewards = _rewards(features, weights[i])
        for k in range(n_starts):
            best = rewards.argmax()
            while rewards[best] > -np.inf and not looks_new(paths, best, chosen[i, :k], least_difference):
                rewards[best] = -np.inf
                best = rewards.argmax()
            chosen[i, k] = best if rewards[best] > -np.inf else chosen[i, 0]
    return chosen


@njit(cache=True)
def _rewards(features, weights):
    """Returns w . Phi; summed here, because a matrix product's last bit depends on how many rows it has."""
    rewards = np.zeros(features.shape[0])
    for i in range(features.shape[0]):
        for k in range(features.shape[1]):
            rewards[i] += weights[k] * features[i, k]
    return rewards
