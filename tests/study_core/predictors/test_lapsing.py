"""The lapsing sigmoid: its formula, its derivatives by finite differences, its mean by quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from study_core.predictors.lapsing import log_likelihood, probability

Z = np.array([-30.0, -6.0, -1.5, -0.2, 0.0, 0.7, 3.0, 25.0])
LAPSE_LOGITS = [-7.0, -3.0, 0.5]
STEP = 1e-5


def rate(lapse_logit):
    return 1.0 / (1.0 + np.exp(-lapse_logit))


def answer_probability(z, lapse_logit):
    return rate(lapse_logit) / 2 + (1 - rate(lapse_logit)) / (1 + np.exp(-z))


@pytest.mark.parametrize("lapse_logit", LAPSE_LOGITS)
def test_the_value_is_the_logarithm_of_the_probability(lapse_logit):
    expected = np.log(answer_probability(Z, lapse_logit))
    np.testing.assert_allclose(log_likelihood(Z, lapse_logit).value, expected, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("lapse_logit", LAPSE_LOGITS)
@pytest.mark.parametrize(
    ("of", "derivative"),
    [
        ("value", "slope"),
        ("slope", "curvature"),
        ("information", "slope_of_information"),
    ],
)
def test_each_derivative_in_z_is_a_finite_difference(lapse_logit, of, derivative):
    ahead, behind = (getattr(log_likelihood(Z + step, lapse_logit), of) for step in (STEP, -STEP))
    expected = (ahead - behind) / (2 * STEP)
    np.testing.assert_allclose(getattr(log_likelihood(Z, lapse_logit), derivative), expected, atol=1e-8)


@pytest.mark.parametrize("lapse_logit", LAPSE_LOGITS)
@pytest.mark.parametrize(
    ("of", "derivative"),
    [
        ("value", "lapse_slope"),
        ("slope", "lapse_slope_of_slope"),
        ("information", "lapse_slope_of_information"),
    ],
)
def test_each_derivative_in_the_lapse_rate_is_a_finite_difference(lapse_logit, of, derivative):
    ahead, behind = (getattr(log_likelihood(Z, lapse_logit + step), of) for step in (STEP, -STEP))
    expected = (ahead - behind) / (2 * STEP)
    np.testing.assert_allclose(getattr(log_likelihood(Z, lapse_logit), derivative), expected, atol=1e-8)


def test_an_answer_no_utility_explains_is_taken_for_a_lapse():
    """However far z is off, the likelihood is that of a lapse and pulls at nothing; nothing overflows."""
    found = log_likelihood(np.array([-1e4]), -3.0)
    assert found.value[0] == pytest.approx(np.log(rate(-3.0) / 2))
    assert found.slope[0] == found.curvature[0] == 0.0


def test_what_looks_like_a_lapse_tells_nothing():
    """Of a rate of 5 %, the curvature's sign changes where the opposite answer is some five times as likely."""
    found = log_likelihood(np.array([-4.0, -2.5, 0.0, 2.5]), -3.0)
    assert (found.curvature[:2] > 0).all()
    np.testing.assert_array_equal(found.information[:2], 0.0)
    np.testing.assert_array_equal(found.slope_of_information[:2], 0.0)
    np.testing.assert_allclose(found.information[2:], -found.curvature[2:])
    assert (found.information[2:] > 0.05).all()


@pytest.mark.parametrize("mean", [-2.0, 0.0, 0.4, 5.0])
@pytest.mark.parametrize("deviation", [0.1, 1.0, 4.0])
def test_the_probability_is_the_mean_over_the_normal_distribution(mean, deviation):
    def integrand(z):
        return answer_probability(z, -2.0) * norm.pdf(z, mean, deviation)

    expected, _ = quad(integrand, mean - 12 * deviation, mean + 12 * deviation, points=[0.0], limit=200)
    found = probability(np.array([mean]), np.array([deviation**2]), -2.0)
    assert found[0] == pytest.approx(expected, abs=2e-4)


def test_what_is_known_for_certain_is_the_bare_formula():
    np.testing.assert_allclose(
        probability(Z, np.zeros_like(Z), -3.0), answer_probability(Z, -3.0), rtol=1e-12
    )


def test_swapping_a_and_b_leaves_a_probability_of_one_in_all():
    means, variances = Z, np.linspace(0.0, 9.0, len(Z))
    both = probability(means, variances, -2.5) + probability(-means, variances, -2.5)
    np.testing.assert_allclose(both, 1.0, rtol=1e-12)
