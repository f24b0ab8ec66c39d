"""The priors are uniform: closed-form moments, and the change of variables against a numerical Jacobian."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from study_core.posterior import kernels
from study_core.posterior.prior import Prior
from tests.study_core import references

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


def weights_on_the_sphere(coordinates):
    simplex = np.append(coordinates, 1.0 - coordinates.sum())
    return simplex / math.sqrt((simplex**2).sum())


@pytest.mark.parametrize("d", [2, 3, 4, 6])
def test_the_density_on_the_sphere_is_the_area_that_the_map_covers(d):
    prior, step = Prior("sphere", d), 1e-6
    coordinates = prior.coordinates(references.prior_draws(np.random.default_rng(d), "sphere", 30, d))
    log_areas = []
    for point in coordinates:
        columns = [
            (weights_on_the_sphere(point + offset) - weights_on_the_sphere(point - offset)) / (2 * step)
            for offset in step * np.eye(d - 1)
        ]
        jacobian = np.array(columns)
        log_areas.append(0.5 * np.linalg.slogdet(jacobian @ jacobian.T)[1])
    constants = prior.log_density(coordinates) - np.array(log_areas)
    np.testing.assert_allclose(constants, constants[0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_the_compiled_density_is_the_densitys_own(support):
    prior = Prior(support, 4)
    coordinates = prior.coordinates(references.prior_draws(np.random.default_rng(3), support, 200))
    for point, weights, density in zip(
        coordinates, prior.weights(coordinates), prior.log_density(coordinates), strict=True
    ):
        filled = np.empty(4)
        assert kernels.prior_log_density(prior.kernel_support, point, filled) == pytest.approx(
            density, abs=1e-12
        )
        np.testing.assert_allclose(filled, weights, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("support", "point"),
    [
        ("ball", [-1e-9, 0.1, 0.1, 0.1]),
        ("ball", [0.1, 0.1, 0.1, -0.5]),
        ("ball", [0.6, 0.6, 0.6, 0.6]),
        ("sphere", [-1e-9, 0.1, 0.1]),
        ("sphere", [0.5, 0.4, 0.2]),
    ],
)
def test_outside_the_support_the_density_is_zero(support, point):
    prior = Prior(support, 4)
    assert kernels.prior_log_density(prior.kernel_support, np.array(point), np.empty(4)) == -math.inf


@pytest.mark.parametrize("length", [1.0 - 1e-12, 1.0 + 1e-12])
def test_the_ball_ends_exactly_at_length_one(length):
    point = length * np.array([0.1, 0.5, 0.5, 0.7])
    density = kernels.prior_log_density(kernels.BALL, point, np.empty(4))
    assert density == (0.0 if length < 1.0 else -math.inf)


@pytest.mark.parametrize("rest", [1e-12, -1e-12])
def test_the_simplex_ends_exactly_where_its_last_weight_is_zero(rest):
    point = np.array([0.2, 0.3, 0.5 - rest])
    assert np.isfinite(kernels.prior_log_density(kernels.SPHERE, point, np.empty(4))) == (rest > 0)
