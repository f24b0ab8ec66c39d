"""Compiled parts of the convergence diagnostics."""

import numpy as np
from numba import njit


@njit(cache=True)
def rank_normalise(values, order, scores):
    """Returns the normal score of each value's rank; equal values share their average rank.

    `order` sorts `values`; `scores[2 r]` is the score of rank r, so half ranks have theirs too.
    """
    n = values.shape[0]
    normalised = np.empty(n)
    first = 0
    while first < n:
        last = first
        while last + 1 < n and values[order[last + 1]] == values[order[first]]:
            last += 1
        score = scores[first + last + 2]
        for i in range(first, last + 1):
            normalised[order[i]] = score
        first = last + 1
    return normalised


@njit(cache=True)
def fold(values, order, median):
    """Returns each value's distance from the median, and the order that sorts the distances, by one merge."""
    n = values.shape[0]
    distances = np.abs(values - median)
    folded_order = np.empty_like(order)
    right = np.searchsorted(values[order], median)
    left = right - 1
    for i in range(n):
        take_left = right == n or (left >= 0 and distances[order[left]] <= distances[order[right]])
        if take_left:
            folded_order[i] = order[left]
            left -= 1
        else:
            folded_order[i] = order[right]
            right += 1
    return distances, folded_order


@njit(cache=True)
def r_hat(chains):
    """Returns the split R-hat of `(n_chains, n_draws)`; the caller has split them."""
    within, between_plus_within = _variances(chains)
    if within <= 0.0:
        return np.inf if between_plus_within > 0.0 else 1.0
    return np.sqrt(between_plus_within / within)


@njit(cache=True)
def _variances(chains):
    """Returns the mean within-chain variance W and the pooled estimate (n - 1)/n W + B/n."""
    n_chains, n_draws = chains.shape
    means = np.empty(n_chains)
    within = 0.0
    for c in range(n_chains):
        means[c] = chains[c].mean()
        within += ((chains[c] - means[c]) ** 2).sum() / (n_draws - 1)
    within /= n_chains
    between = ((means - means.mean()) ** 2).sum() / (n_chains - 1)
    return within, within * (n_draws - 1) / n_draws + between


@njit(cache=True)
def effective_sample_size(chains):
    """Returns the ESS of `(n_chains, n_draws)` from Geyer's initial monotone sequence of paired autocorrelations.

    Autocovariances are computed lag by lag, up to where the sequence ends: a few dozen lags, not thousands.
    """
    n_chains, n_draws = chains.shape
    within, pooled = _variances(chains)
    if within <= 0.0:
        return 0.0
    centred = np.empty_like(chains)
    for c in range(n_chains):
        centred[c] = chains[c] - chains[c].mean()
    even, odd = 1.0, 1.0 - (within - _autocovariance(centred, 1)) / pooled
    # Lags are paired: the sum of each pair is positive and falls, until noise takes over.
    total, smallest_pair = even + odd, even + odd
    last_even = 0.0
    lag = 2
    while lag < n_draws - 2:
        even = 1.0 - (within - _autocovariance(centred, lag)) / pooled
        odd = 1.0 - (within - _autocovariance(centred, lag + 1)) / pooled
        pair = even + odd
        # The last pair looked at counts by its even lag alone.
        last_even = max(even, 0.0) if pair < 0.0 else even
        if pair <= 0.0 or lag + 2 >= n_draws - 2:
            break
        smallest_pair = min(smallest_pair, pair)
        total += smallest_pair
        lag += 2
    n = n_chains * n_draws
    return n / max(-1.0 + 2.0 * total + last_even, 1.0 / np.log10(n))


@njit(cache=True, fastmath={"reassoc", "contract"})
def _autocovariance(centred, lag):
    """Returns the autocovariance at one lag, averaged over chains."""
    n_chains, n_draws = centred.shape
    total = 0.0
    for c in range(n_chains):
        early, late = centred[c, : n_draws - lag], centred[c, lag:]
        for t in range(n_draws - lag):
            total += early[t] * late[t]
    return total / (n_chains * n_draws)
