"""The target is prior times likelihood, in coordinates that are standard normal where nothing is known."""

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import kstest

from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior.prior import Prior
from study_core.posterior.target import Target
from tests.study_core import references

RNG = np.random.default_rng(3)
ANSWERS = ComparisonSet(RNG.normal(0, 0.2, (30, 4)), RNG.choice([-1.0, 1.0], 30))
WITH_TIES = ComparisonSet(ANSWERS.feature_diffs, RNG.choice([-1.0, 0.0, 1.0], 30))
MODELS = {
    "all fixed": ResponseModel("sigmoid", 40.0, 0.1),
    "rationality": ResponseModel("sigmoid", "inferred", 0.1),
    "lapse rate": ResponseModel("sigmoid", 40.0, "inferred"),
    "both": ResponseModel("sigmoid", "inferred", "inferred"),
    "threshold": ResponseModel("sigmoid", 40.0, 0.0, "inferred"),
    "all three": ResponseModel("sigmoid", "inferred", "inferred", "inferred"),
}


@pytest.mark.parametrize("support", ["ball", "sphere"])
@pytest.mark.parametrize("name", MODELS)
def test_the_log_likelihood_is_that_of_each_points_own_weights_and_parameters(support, name):
    model = MODELS[name]
    comparisons = WITH_TIES if model.tie_threshold else ANSWERS
    target = Target(Prior(support, 4), model, comparisons)
    points = np.random.default_rng(1).normal(size=(50, target.n_coordinates))
    assert target.n_coordinates == Prior(support, 4).n_coordinates + len(model.inferred)
    rows = target.parameters(points)
    expected = references.log_likelihoods(
        comparisons.feature_diffs,
        comparisons.signs,
        target.weights(points),
        rows.rationality,
        rows.lapse_rate,
        rows.tie_threshold,
    )
    np.testing.assert_allclose(target.log_densities(points)[1], expected, rtol=1e-11)


def test_the_parameters_are_read_from_the_last_coordinates_in_their_order():
    target = Target(Prior("sphere", 3), MODELS["all three"], WITH_TIES)
    rows = target.parameters(np.array([[0.0, 0.0, 1.0, -2.0, 0.5]]))
    assert rows.rationality[0] == pytest.approx(50.0 * np.exp(1.5))
    assert rows.lapse_rate[0] == pytest.approx(expit(-5.0))
    assert rows.tie_threshold[0] == pytest.approx(np.exp(0.5))


@pytest.mark.parametrize("name", MODELS)
def test_the_prior_of_the_parameters_is_standard_normal_and_independent(name):
    target = Target(Prior("sphere", 4), MODELS[name], ANSWERS)
    points = np.random.default_rng(2).normal(size=(20, target.n_coordinates))
    moved = points.copy()
    moved[:, 3:] = 0.0
    difference = target.log_densities(points)[0] - target.log_densities(moved)[0]
    np.testing.assert_allclose(difference, -0.5 * (points[:, 3:] ** 2).sum(axis=1), atol=1e-12)


@pytest.mark.statistical
@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_draws_from_the_prior_have_the_priors_density(support):
    """Weighted from one to a wide normal by the density alone, they have that normal's moments."""
    target = Target(Prior(support, 3), MODELS["both"], ANSWERS)
    points = target.draw_prior(np.random.default_rng(5), 200_000)
    n = target.n_coordinates
    log_narrow = -0.5 * ((points - 0.3) ** 2 / 0.25).sum(axis=1) - 0.5 * n * np.log(2 * np.pi * 0.25)
    ratios = np.exp(log_narrow - (target.log_densities(points)[0] - target.log_normaliser))
    error = ratios.std() / np.sqrt(len(ratios))
    assert ratios.mean() == pytest.approx(1.0, abs=4.5 * error)
    assert error < 0.02
    means = (ratios[:, None] * points).mean(axis=0)
    errors = (ratios[:, None] * points).std(axis=0) / np.sqrt(len(points))
    assert (np.abs(means - 0.3) < 4.5 * errors).all()
    for column in points[:, -2:].T:
        assert kstest(column, "norm").pvalue > 1e-3


def test_too_far_out_the_density_is_zero_and_never_nan():
    target = Target(
        Prior("sphere", 20), ResponseModel("sigmoid", "inferred", "inferred"), ComparisonSet.empty(20)
    )
    for far in (30.0, 1e3, 1e200):
        log_priors, log_likelihoods = target.log_densities(np.full((1, 21), -far))
        assert log_priors[0] < -1e4
        assert not np.isnan(log_likelihoods[0])
