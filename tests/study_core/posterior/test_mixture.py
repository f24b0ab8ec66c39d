"""The mixture against scipy's multivariate t and normal."""

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal, multivariate_t, t

from study_core.posterior.mixture import DEGREES_OF_FREEDOM, Mixture, fit


def some_mixture(n, n_components, seed=0):
    rng = np.random.default_rng(seed)
    roots = 0.3 * rng.normal(size=(n_components, n, n)) + np.eye(n)
    factors = np.linalg.cholesky(roots @ roots.transpose(0, 2, 1))
    shares = rng.random(n_components) + 0.1
    return Mixture(shares / shares.sum(), 2 * rng.normal(size=(n_components, n)), factors)


def density(mixture, points):
    parts = [
        share * multivariate_t(mean, factor @ factor.T, df=DEGREES_OF_FREEDOM).pdf(points)
        for share, mean, factor in zip(mixture.shares, mixture.means, mixture.factors, strict=True)
    ]
    return sum(parts)


@pytest.mark.parametrize("n", [1, 2, 3, 6, 21])
@pytest.mark.parametrize("n_components", [1, 4, 8])
def test_the_density_is_scipys(n, n_components):
    mixture = some_mixture(n, n_components)
    points = np.random.default_rng(1).normal(0, 4, (200, n))
    np.testing.assert_allclose(mixture.log_density(points), np.log(density(mixture, points)), rtol=1e-9)


def test_a_share_of_another_mixture_is_drawn_from_that_one():
    one, other = some_mixture(3, 2), Mixture.standard(3)
    both = one.with_share(other, 0.2)
    points = np.random.default_rng(1).normal(0, 2, (100, 3))
    expected = 0.8 * density(one, points) + 0.2 * density(other, points)
    np.testing.assert_allclose(np.exp(both.log_density(points)), expected, rtol=1e-9)


def test_far_out_the_density_is_small_and_never_zero():
    mixture = some_mixture(3, 8)
    values = mixture.log_density(np.array([[1e3, 0.0, 0.0], [1e9, 1e9, 1e9]]))
    assert np.isfinite(values).all()
    assert values[1] < values[0] < -20


@pytest.mark.statistical
@pytest.mark.parametrize("n", [1, 3, 8])
def test_the_draws_have_the_density(n):
    """One component's squared distances are F-distributed; several have the right shares and places."""
    mixture = some_mixture(n, 1)
    points = mixture.draw(np.random.default_rng(2), 50_000)
    whitened = np.linalg.solve(mixture.factors[0], (points - mixture.means[0]).T)
    assert kstest((whitened**2).sum(axis=0) / n, "f", args=(n, DEGREES_OF_FREEDOM)).pvalue > 1e-3
    # A projection of a mixture of t distributions is the mixture of their projections.
    several, direction = some_mixture(n, 5, seed=3), np.linspace(1.0, -0.5, n)
    centres = several.means @ direction
    scales = np.linalg.norm(np.einsum("kij,i->kj", several.factors, direction), axis=1)

    def distribution(x):
        return t.cdf((x[:, None] - centres) / scales, DEGREES_OF_FREEDOM) @ several.shares

    projected = several.draw(np.random.default_rng(4), 50_000) @ direction
    assert kstest(projected, distribution).pvalue > 1e-3


@pytest.mark.statistical
def test_a_fit_finds_the_components_of_a_mixture_of_normals():
    rng = np.random.default_rng(5)
    truth = [(0.6, [-3.0, 0.0], [[1.0, 0.5], [0.5, 1.0]]), (0.4, [3.0, 1.0], [[0.2, 0.0], [0.0, 2.0]])]
    points = np.vstack([rng.multivariate_normal(mean, cov, int(4000 * share)) for share, mean, cov in truth])
    fitted = fit(rng, points, np.ones(len(points)), 2, 30)
    order = np.argsort(fitted.means[:, 0])
    for k, (share, mean, covariance) in zip(order, truth, strict=True):
        scale = fitted.factors[k] @ fitted.factors[k].T / 1.2
        assert fitted.shares[k] == pytest.approx(share, abs=0.02)
        np.testing.assert_allclose(fitted.means[k], mean, atol=0.1)
        np.testing.assert_allclose(scale, covariance, atol=0.12)


@pytest.mark.statistical
def test_weighted_points_are_fitted_like_the_distribution_that_they_stand_for():
    """Points of a wide normal, weighted to a narrow one elsewhere."""
    rng = np.random.default_rng(6)
    points = rng.normal(0.0, 3.0, (20_000, 2))
    weights = multivariate_normal([1.0, -1.0], 0.5 * np.eye(2)).pdf(points) / multivariate_normal(
        [0.0, 0.0], 9.0 * np.eye(2)
    ).pdf(points)
    fitted = fit(rng, points, weights * 0.1, 1, 3)
    np.testing.assert_allclose(fitted.means[0], [1.0, -1.0], atol=0.05)
    np.testing.assert_allclose(fitted.factors[0] @ fitted.factors[0].T / 1.2, 0.5 * np.eye(2), atol=0.08)


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e6])
def test_a_fit_works_at_any_scale(scale):
    points = np.random.default_rng(7).normal(size=(300, 3))
    one = fit(np.random.default_rng(8), points, np.ones(300), 4, 4)
    other = fit(np.random.default_rng(8), scale * points, np.ones(300), 4, 4)
    np.testing.assert_allclose(other.means, scale * one.means, rtol=1e-5, atol=1e-6 * scale)
    np.testing.assert_allclose(other.factors, scale * one.factors, rtol=1e-4, atol=1e-6 * scale)


def test_points_that_span_too_little_still_give_a_proposal():
    points = np.random.default_rng(9).normal(size=(5, 8))
    fitted = fit(np.random.default_rng(1), points, np.ones(5), 4, 4)
    assert np.isfinite(fitted.log_density(fitted.draw(np.random.default_rng(2), 10))).all()
