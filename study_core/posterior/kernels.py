"""Compiled adaptive Metropolis: several chains in lockstep on one log-density.

All randomness comes in as arrays, so a chain is a pure function of its arguments.
"""

import math

import numpy as np
from numba import njit

from study_core.choice_kernels import log_likelihood

BALL = 0
SPHERE = 1

# Roberts, Gelman and Gilks (1997): the best acceptance rate falls to 0.234; 0.3 is near the best in 3 or 4 dimensions.
_TARGET_ACCEPTANCE = 0.3
_STEPS_PER_ADAPTATION = 20
_SMALLEST_VARIANCE = 1e-10


@njit(cache=True)
def prior_log_density(support, point, weights):
    """Fills `weights` from the coordinates `point`; returns the log prior density there, -inf outside."""
    d = weights.shape[0]
    squared = 0.0
    if support == BALL:
        for k in range(d):
            if point[k] < 0.0:
                return -math.inf
            weights[k] = point[k]
            squared += point[k] * point[k]
        return 0.0 if squared <= 1.0 else -math.inf
    last = 1.0
    for k in range(d - 1):
        if point[k] < 0.0:
            return -math.inf
        weights[k] = point[k]
        squared += point[k] * point[k]
        last -= point[k]
    if last < 0.0:
        return -math.inf
    weights[d - 1] = last
    length = math.sqrt(squared + last * last)
    for k in range(d):
        weights[k] /= length
    return -d * math.log(length)


@njit(cache=True)
def _metropolis_step(target, point, log_density, factor, normals, exponential, proposal, weights):
    """Moves one chain in place; returns its new log-density and whether it moved."""
    support, kind, packed, n_answers, rationality, lapse_rate = target
    n = point.shape[0]
    for i in range(n):
        proposal[i] = point[i]
        for j in range(i + 1):
            proposal[i] += factor[i, j] * normals[j]
    # log(uniform) is minus an exponential variate: the proposal is accepted at or above this density.
    floor = log_density - exponential
    log_prior = prior_log_density(support, proposal, weights)
    if log_prior == -math.inf:
        return log_density, False
    proposed = log_prior + log_likelihood(
        kind, weights, packed, n_answers, rationality, lapse_rate, floor - log_prior
    )
    if proposed < floor:
        return log_density, False
    point[:] = proposal
    return proposed, True


@njit(cache=True)
def adapt(target, points, log_densities, covariance, normals, exponentials):
    """Warms the chains up, learning one proposal from all of them (Haario 2001; Andrieu and Thoms 2008, alg. 4).

    Args:
        target: (support, response kind, packed diffs, number of answers, rationality, lapse rate).
        points: Coordinates of each chain, `(n_chains, n)`; moved in place.
        log_densities: Log-density of each chain, `(n_chains,)`; updated in place.
        covariance: First guess of the posterior's covariance, `(n, n)`.
        normals: Standard normal variates, `(n_steps, n_chains, n)`.
        exponentials: Standard exponential variates, `(n_steps, n_chains)`.

    Returns:
        The lower Cholesky factor of the proposal's covariance, to be used unchanged from here on.
    """
    n_steps, n_chains, n = normals.shape
    proposal, weights = np.empty(n), np.empty(target[2].shape[1])
    mean = np.zeros(n)
    scatter = np.zeros((n, n))
    n_seen = 0
    log_scale = math.log(2.38 * 2.38 / n)
    learn_from = n_steps // 5
    factor = _proposal_factor(covariance, log_scale)
    n_accepted = 0
    for t in range(n_steps):
        for c in range(n_chains):
            log_densities[c], moved = _metropolis_step(
                target,
                points[c],
                log_densities[c],
                factor,
                normals[t, c],
                exponentials[t, c],
                proposal,
                weights,
            )
            n_accepted += moved
            if t >= learn_from:
                n_seen += 1
                _update_moments(points[c], n_seen, mean, scatter)
        if (t + 1) % _STEPS_PER_ADAPTATION == 0:
            rate = n_accepted / (n_chains * _STEPS_PER_ADAPTATION)
            log_scale += (rate - _TARGET_ACCEPTANCE) * 3.0 / math.sqrt(1.0 + t / _STEPS_PER_ADAPTATION)
            n_accepted = 0
            if n_seen > 20 * n:
                covariance = scatter / n_seen
            factor = _proposal_factor(covariance, log_scale)
    return factor


@njit(cache=True)
def _update_moments(point, n_seen, mean, scatter):
    """Adds one point to the running mean and sum of squared deviations (Welford)."""
    delta = point - mean
    mean += delta / n_seen
    scatter += np.outer(delta, point - mean)


@njit(cache=True)
def _proposal_factor(covariance, log_scale):
    n = covariance.shape[0]
    regularised = covariance + _SMALLEST_VARIANCE * np.eye(n)
    return np.linalg.cholesky(math.exp(log_scale) * regularised)


@njit(cache=True)
def sample(target, points, log_densities, factor, normals, exponentials):
    """Draws from every chain with one fixed proposal.

    Returns:
        Coordinates `(n_chains, n_steps, n)`, log-densities `(n_chains, n_steps)` and the share of moves accepted.
    """
    n_steps, n_chains, n = normals.shape
    proposal, weights = np.empty(n), np.empty(target[2].shape[1])
    draws = np.empty((n_chains, n_steps, n))
    draw_log_densities = np.empty((n_chains, n_steps))
    n_accepted = 0
    for t in range(n_steps):
        for c in range(n_chains):
            log_densities[c], moved = _metropolis_step(
                target,
                points[c],
                log_densities[c],
                factor,
                normals[t, c],
                exponentials[t, c],
                proposal,
                weights,
            )
            n_accepted += moved
            draws[c, t] = points[c]
            draw_log_densities[c, t] = log_densities[c]
    return draws, draw_log_densities, n_accepted / (n_steps * n_chains)
