"""The priors are uniform: closed-form moments, and the change of variables against a numerical Jacobian."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest, norm

from study_core.posterior import kernels
from study_core.posterior.prior import Prior

N = 200_000


def assert_mean(values, expected):
    """Within 4.5 standard errors of a closed form."""
    error = np.std(values, axis=0) / math.sqrt(len(values))
    assert (np.abs(np.mean(values, axis=0) - expected) < 4.5 * error).all()


@pytest.mark.statistical
@pytest.mark.parametrize("d", [2, 3, 4, 7])
def test_the_ball_is_uniform(d):
    draws = Prior("ball", d).draw(np.random.default_rng(d), N)
    lengths = np.linalg.norm(draws, axis=1)
    assert (draws >= 0).all()
    assert (lengths <= 1).all()
    assert_mean(lengths, d / (d + 1))
    assert kstest(lengths**d, "uniform").pvalue > 1e-4
    # E w_i^2 = 1 / (d + 2) in the ball.
    assert_mean(draws**2, 1 / (d + 2))


@pytest.mark.statistical
@pytest.mark.parametrize("d", [2, 3, 4, 7])
def test_the_sphere_is_uniform(d):
    draws = Prior("sphere", d).draw(np.random.default_rng(10 + d), N)
    np.testing.assert_allclose(np.linalg.norm(draws, axis=1), 1.0, rtol=0, atol=1e-14)
    assert (draws >= 0).all()
    assert_mean(draws, math.gamma(d / 2) / (math.sqrt(math.pi) * math.gamma((d + 1) / 2)))
    assert_mean(draws**2, 1 / d)
    assert_mean(draws[:, 0] * draws[:, 1], 2 / (math.pi * d))
    assert_mean(draws**4, 3 / (d * (d + 2)))


@pytest.mark.parametrize("support", ["ball", "sphere"])
@given(seed=st.integers(0, 10**6), d=st.integers(2, 7))
def test_weights_survive_the_way_through_the_samplers_coordinates(support, seed, d):
    prior = Prior(support, d)
    weights = prior.draw(np.random.default_rng(seed), 3)
    coordinates = prior.coordinates(weights)
    assert coordinates.shape == (3, prior.n_coordinates)
    np.testing.assert_allclose(prior.weights(coordinates), weights, rtol=0, atol=1e-14)


def weights_at(support, d, coordinates):
    """The map in the docstring, one angle at a time."""
    angles = 0.5 * math.pi * norm.cdf(coordinates[: d - 1])
    weights = [math.prod(np.sin(angles[:k])) * math.cos(angles[k]) for k in range(d - 1)]
    weights = np.array([*weights, math.prod(np.sin(angles))])
    return weights if support == "sphere" else weights * norm.cdf(coordinates[d - 1]) ** (1 / d)


def log_size(support, d):
    """Area of the sphere's, or volume of the ball's, part with nonnegative coordinates."""
    if support == "sphere":
        return 0.5 * d * math.log(math.pi) - (d - 1) * math.log(2.0) - math.lgamma(d / 2)
    return 0.5 * d * math.log(math.pi) - d * math.log(2.0) - math.lgamma(d / 2 + 1)


@pytest.mark.parametrize("support", ["ball", "sphere"])
@pytest.mark.parametrize("d", [2, 3, 4, 6])
def test_the_density_is_the_area_that_the_map_covers_and_is_normalised(support, d):
    prior, step = Prior(support, d), 1e-5
    points = np.random.default_rng(d).normal(size=(30, prior.n_coordinates))
    for point in points:
        columns = [
            (weights_at(support, d, point + offset) - weights_at(support, d, point - offset)) / (2 * step)
            for offset in step * np.eye(len(point))
        ]
        jacobian = np.array(columns)
        log_area = 0.5 * np.linalg.slogdet(jacobian @ jacobian.T)[1]
        filled = np.empty(d)
        found = kernels.log_prior(prior.kernel_support, point, filled) - prior.log_normaliser
        assert found == pytest.approx(log_area - log_size(support, d), abs=1e-6)
        np.testing.assert_allclose(filled, weights_at(support, d, point), rtol=0, atol=1e-14)
        np.testing.assert_array_equal(prior.weights(point[None])[0], filled)


@pytest.mark.parametrize("support", ["ball", "sphere"])
@pytest.mark.parametrize("far", [5.0, 20.0, 40.0, 1e6])
@pytest.mark.parametrize("d", [2, 4, 20])
def test_far_out_the_weights_stay_in_the_support_and_the_density_is_never_nan(support, far, d):
    prior = Prior(support, d)
    for sign in (-1.0, 1.0):
        weights = np.empty(d)
        point = np.full(prior.n_coordinates, sign * far)
        density = kernels.log_prior(prior.kernel_support, point, weights)
        assert not np.isnan(density)
        assert density < -0.4 * far**2
        assert (weights >= 0).all()
        assert np.linalg.norm(weights) <= 1 + 1e-12


@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_a_weight_of_nearly_zero_keeps_its_digits(support):
    prior = Prior(support, 3)
    for k in range(3):
        weights = np.array([[0.5, 0.4, 0.6]])
        weights[0, k] = 1e-12
        weights /= np.linalg.norm(weights) * (1.0 if support == "sphere" else 1.5)
        found = prior.weights(prior.coordinates(weights))
        np.testing.assert_allclose(found, weights, rtol=1e-3, atol=1e-16)
