"""Compiled parts of the Student's t mixture."""

import math

import numpy as np
from numba import njit

# What a component keeps of the overall covariance, in draws: enough that none collapses onto a few of them.
_DRAWS_OF_OVERALL_COVARIANCE = 1.0
_RIDGE = 1e-9


@njit(cache=True)
def log_density(mixture, point):
    """Returns the log-density of a mixture of Student's t distributions at a point.

    Args:
        mixture: Means `(n, n_components)`, inverse Cholesky factors `(n, n, n_components)`, scaled weights
            `(n_components,)`, what scales them, and the degrees of freedom, a whole number. Components come last, so
            that the compiler works on all at once.
        point: Coordinates, `(n,)`.
    """
    means, whitenings, scaled_weights, log_scale, degrees = mixture
    n, n_components = means.shape
    distances = np.zeros(n_components)
    whitened = np.empty(n_components)
    for i in range(n):
        whitened[:] = 0.0
        for j in range(i + 1):
            for k in range(n_components):
                whitened[k] += whitenings[i, j, k] * (point[j] - means[j, k])
        for k in range(n_components):
            distances[k] += whitened[k] * whitened[k]
    total = 0.0
    for k in range(n_components):
        # (1 + distance / degrees)^(-(degrees + n) / 2) by products: no logarithm for each component.
        base = 1.0 / (1.0 + distances[k] / degrees)
        power = math.sqrt(base) if (degrees + n) % 2 == 1 else 1.0
        for _ in range((degrees + n) // 2):
            power *= base
        total += scaled_weights[k] * power
    return log_scale + math.log(total)


@njit(cache=True)
def log_densities(mixture, points):
    """Returns `log_density` of each row."""
    values = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        values[i] = log_density(mixture, points[i])
    return values


@njit(cache=True)
def fit_normals(points, point_weights, means, n_rounds):
    """Fits a mixture of normals to weighted points by expectation maximisation.

    Args:
        points: `(n_points, n)`.
        point_weights: Nonnegative, adding up to the number of points that they are worth, `(n_points,)`.
        means: Where the components begin, `(n_components, n)`; moved in place.
        n_rounds: How many times the components are fitted anew.

    Returns:
        Shares `(n_components,)` and lower Cholesky factors `(n_components, n, n)`.
    """
    n_points, n = points.shape
    n_components = means.shape[0]
    overall = _covariance(points, point_weights) * n_components ** (-2.0 / n)
    worth = point_weights.sum()
    shares = np.full(n_components, 1.0 / n_components)
    factors = np.empty((n_components, n, n))
    for k in range(n_components):
        factors[k] = _cholesky(overall)
    whitening = np.empty((n_components, n, n))
    log_heights, belongs = np.empty(n_components), np.empty(n_components)
    for _ in range(n_rounds):
        for k in range(n_components):
            whitening[k] = np.linalg.inv(factors[k])
            log_heights[k] = math.log(shares[k]) - np.log(np.diag(factors[k])).sum()
        counts, sums = np.zeros(n_components), np.zeros((n_components, n))
        products = np.zeros((n_components, n, n))
        for a in range(n_points):
            _belonging(points[a], means, whitening, log_heights, belongs)
            for k in range(n_components):
                share = point_weights[a] * belongs[k]
                counts[k] += share
                # Deviations from the round's own mean keep their digits however far the points lie from 0.
                for i in range(n):
                    deviation = share * (points[a, i] - means[k, i])
                    sums[k, i] += deviation
                    for j in range(i + 1):
                        products[k, i, j] += deviation * (points[a, j] - means[k, j])
        for k in range(n_components):
            shift = sums[k] / (counts[k] + 1e-300)
            covariance = products[k] - counts[k] * np.outer(shift, shift)
            for i in range(n):
                for j in range(i):
                    covariance[j, i] = covariance[i, j]
            means[k] += shift
            kept = _DRAWS_OF_OVERALL_COVARIANCE * n
            factors[k] = _cholesky((covariance + kept * overall) / (counts[k] + kept))
            shares[k] = (counts[k] + 1.0) / (worth + n_components)
    return shares, factors


@njit(cache=True)
def _belonging(point, means, whitening, log_heights, belongs):
    """Fills the probability that a point belongs to each component."""
    n_components, n = means.shape
    highest = -math.inf
    for k in range(n_components):
        distance = 0.0
        for i in range(n):
            whitened = 0.0
            for j in range(i + 1):
                whitened += whitening[k, i, j] * (point[j] - means[k, j])
            distance += whitened * whitened
        belongs[k] = log_heights[k] - 0.5 * distance
        highest = max(highest, belongs[k])
    total = 0.0
    for k in range(n_components):
        belongs[k] = math.exp(belongs[k] - highest)
        total += belongs[k]
    for k in range(n_components):
        belongs[k] /= total


@njit(cache=True)
def _covariance(points, point_weights):
    n_points, n = points.shape
    worth = point_weights.sum()
    mean = np.zeros(n)
    for a in range(n_points):
        mean += point_weights[a] * points[a]
    mean /= worth
    covariance = np.zeros((n, n))
    for a in range(n_points):
        for i in range(n):
            for j in range(n):
                covariance[i, j] += point_weights[a] * (points[a, i] - mean[i]) * (points[a, j] - mean[j])
    return covariance / worth


@njit(cache=True)
def _cholesky(covariance):
    """Returns the lower factor; a little more of the variances makes it one where few points span the space."""
    return np.linalg.cholesky(covariance + _RIDGE * np.diag(np.diag(covariance)))


@njit(cache=True)
def place(component, means, factors, variates):
    """Returns mean + factor variate of each row's own component."""
    n_points, n = variates.shape
    points = np.empty((n_points, n))
    for a in range(n_points):
        k = component[a]
        for i in range(n):
            points[a, i] = means[k, i]
            for j in range(i + 1):
                points[a, i] += factors[k, i, j] * variates[a, j]
    return points
