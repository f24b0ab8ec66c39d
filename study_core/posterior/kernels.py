"""Compiled densities and the compiled Metropolis-Hastings chains.

All randomness comes in as arrays, so a chain is a pure function of its arguments.
"""

import math

import numpy as np
from numba import njit

from study_core.choice_kernels import log_likelihood
from study_core.posterior.mixture_kernels import log_density

BALL = 0
SPHERE = 1

# Support, number of features, response kind, response parameters, packed answers, and mean and precision of what the
# people before care for (empty without them); see `Target.for_kernels`.
KernelTarget = tuple[
    int,
    int,
    int,
    tuple[np.ndarray, ...],
    tuple[np.ndarray, int, np.ndarray],
    tuple[np.ndarray, np.ndarray],
]

_QUARTER_PI = 0.25 * math.pi
_SQRT_HALF = math.sqrt(0.5)


@njit(cache=True)
def log_prior(support, point, weights):
    """Fills `weights` from the coordinates `point`; returns the log prior density there, up to a constant."""
    d = weights.shape[0]
    # What is left of the length after k angles, and the product of that over all but the last: sin(a_k)^(d - 1 - k).
    remaining, density = 1.0, 1.0
    for k in range(d - 1):
        # The smaller of the angle and its complement keeps its digits.
        smaller = _QUARTER_PI * math.erfc(abs(point[k]) * _SQRT_HALF)
        if point[k] > 0.0:
            weights[k] = remaining * math.sin(smaller)
            remaining *= math.cos(smaller)
        else:
            weights[k] = remaining * math.cos(smaller)
            remaining *= math.sin(smaller)
        if k < d - 2:
            density *= remaining
    weights[d - 1] = remaining
    if support == BALL:
        length = (0.5 * math.erfc(-point[d - 1] * _SQRT_HALF)) ** (1.0 / d)
        for k in range(d):
            weights[k] *= length
    squared = 0.0
    for i in range(point.shape[0]):
        squared += point[i] * point[i]
    # Too far out for the product to be a number: nothing can be there.
    return math.log(density) - 0.5 * squared if density > 0.0 else -math.inf


@njit(cache=True)
def all_weights(support, n_features, points):
    """Returns the weights at each row of coordinates."""
    weights = np.empty((points.shape[0], n_features))
    for i in range(points.shape[0]):
        log_prior(support, points[i], weights[i])
    return weights


@njit(cache=True)
def _parameters(response, point):
    """Returns rationality, lapse rate and tie threshold at the coordinates `point`."""
    fixed, places, locations, scales = response
    rationality, lapse_rate, tie_threshold = fixed[0], fixed[1], fixed[2]
    if places[0] >= 0:
        rationality = math.exp(locations[0] + scales[0] * point[places[0]])
    if places[1] >= 0:
        lapse_rate = 1.0 / (1.0 + math.exp(-locations[1] - scales[1] * point[places[1]]))
    if places[2] >= 0:
        tie_threshold = math.exp(locations[2] + scales[2] * point[places[2]])
    return rationality, lapse_rate, tie_threshold


@njit(cache=True)
def _log_population(population, response, point, weights):
    """Returns by how much the people before change the log prior at a point, up to a constant.

    Their normal density of u = beta w takes the place of the uniform one of w and of the log-normal one of beta. In
    polar coordinates u has the volume beta^(d - 1) dbeta, and beta dz is proportional to dbeta.
    """
    mean, precision = population
    _, places, locations, scales = response
    coordinate = point[places[0]]
    log_rationality = locations[0] + scales[0] * coordinate
    rationality = math.exp(log_rationality)
    squared = 0.0
    for i in range(mean.shape[0]):
        row = 0.0
        for j in range(mean.shape[0]):
            row += precision[i, j] * (rationality * weights[j] - mean[j])
        squared += row * (rationality * weights[i] - mean[i])
    if not squared < math.inf:
        # Too far out for u to be a number: nothing can be there.
        return -math.inf
    return 0.5 * coordinate * coordinate + mean.shape[0] * log_rationality - 0.5 * squared


@njit(cache=True)
def _log_posterior(target, point, weights, floor):
    """Returns log prior + log-likelihood at a point, or anything below `floor` if it is below; fills `weights`."""
    prior = log_prior(target[0], point, weights)
    if target[5][0].shape[0] > 0:
        prior += _log_population(target[5], target[3], point, weights)
    if prior < floor:
        # The likelihood is at most 1.
        return prior
    rationality, lapse_rate, tie_threshold = _parameters(target[3], point)
    return prior + log_likelihood(
        target[2], weights, rationality, lapse_rate, tie_threshold, target[4], floor - prior
    )


@njit(cache=True)
def log_densities(target, points):
    """Returns the log prior density and the log-likelihood of each point; a point too far out has -inf and 0.

    What the people before say counts as an answer here. So the prior is one whose draws are exact, and on the way from
    it to the posterior they come in together with the answers.
    """
    n = points.shape[0]
    weights = np.empty(target[1])
    priors, likelihoods = np.empty(n), np.zeros(n)
    for i in range(n):
        priors[i] = log_prior(target[0], points[i], weights)
        if priors[i] > -math.inf:
            rationality, lapse_rate, tie_threshold = _parameters(target[3], points[i])
            likelihoods[i] = log_likelihood(
                target[2], weights, rationality, lapse_rate, tie_threshold, target[4], -math.inf
            )
            if target[5][0].shape[0] > 0:
                likelihoods[i] += _log_population(target[5], target[3], points[i], weights)
    return priors, likelihoods


@njit(cache=True)
def sample(target, points, mixture, walk_factor, leaps, leap_densities, steps, exponentials):
    """Draws from every chain with fixed proposals.

    A draw ends a sweep: first some leaps, whose proposals come from the mixture and don't depend on where the chain
    is (Tierney 1994, sec. 2.3.3), then some steps of a random walk, which move a chain that the mixture doesn't fit.

    Args:
        target: See `Target.for_kernels`.
        points: Coordinates of each chain, `(n_chains, n)`; moved in place.
        mixture: See `mixture_kernels.log_density`.
        walk_factor: Lower Cholesky factor of the random walk's covariance, `(n, n)`.
        leaps: Draws from the mixture, `(n_chains, n_draws, n_leaps, n)`.
        leap_densities: Log-density of the mixture at each, `(n_chains, n_draws, n_leaps)`.
        steps: Standard normal variates of the random walk, `(n_chains, n_draws, n_steps, n)`.
        exponentials: Standard exponential variates, `(n_chains, n_draws, n_leaps + n_steps)`.

    Returns:
        Coordinates of every chain after each sweep, `(n_chains, n_draws, n)`, and how many leaps were accepted.
    """
    n_chains, n_draws, n_leaps, n = leaps.shape
    n_steps = steps.shape[2]
    proposal, weights = np.empty(n), np.empty(target[1])
    draws = np.empty((n_chains, n_draws, n))
    n_accepted = 0
    for c in range(n_chains):
        point = points[c]
        density = _log_posterior(target, point, weights, -math.inf)
        leap_density = log_density(mixture, point)
        for t in range(n_draws):
            # log(uniform) is minus an exponential variate: a proposal is accepted at or above the floor.
            for s in range(n_leaps):
                gained = leap_densities[c, t, s] - leap_density
                floor = density + gained - exponentials[c, t, s]
                proposed = _log_posterior(target, leaps[c, t, s], weights, floor)
                if proposed >= floor:
                    point[:] = leaps[c, t, s]
                    density, leap_density = proposed, leap_densities[c, t, s]
                    n_accepted += 1
            for s in range(n_steps):
                for i in range(n):
                    proposal[i] = point[i]
                    for j in range(i + 1):
                        proposal[i] += walk_factor[i, j] * steps[c, t, s, j]
                floor = density - exponentials[c, t, n_leaps + s]
                proposed = _log_posterior(target, proposal, weights, floor)
                if proposed >= floor:
                    point[:] = proposal
                    density, leap_density = proposed, log_density(mixture, proposal)
            draws[c, t] = point
    return draws, n_accepted
