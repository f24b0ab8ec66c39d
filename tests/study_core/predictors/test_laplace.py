"""The normal approximation against a dense one by finite differences, and against brute force."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime, minimize
from scipy.special import expit
from scipy.stats import multivariate_t

from study_core.predictors import laplace
from study_core.predictors.laplace import Prior, Weights, approximate
from study_core.predictors.lapsing import log_likelihood, probability

N_PEOPLE, N_ANSWERS, K = 3, 12, 2


def some_prior(k=K, personal_precision=2.0, lapse_logit=-2.0):
    return Prior(
        np.linspace(-0.3, 0.5, k), np.eye(k) * 1.5 + 0.3 * np.ones((k, k)), personal_precision, lapse_logit
    )


def some_answers(seed, n_people=N_PEOPLE, n=N_ANSWERS, k=K):
    """Answers of people who care for the first feature, not always."""
    rng = np.random.default_rng(seed)
    diffs = rng.normal(size=(n_people, n, k))
    return diffs * np.sign(1.5 * diffs[..., :1] + rng.logistic(size=(n_people, n, 1)))


def log_posterior(vector, prior, signed_diffs):
    """Written plainly, of one long vector: w_0, then each w_u. Normalised prior; likelihood as it is."""
    k = signed_diffs.shape[2]
    shared, personal = vector[:k], vector[k:].reshape(-1, k)
    lapse = 1 / (1 + np.exp(-prior.lapse_logit))
    total = -0.5 * (shared - prior.mean) @ prior.precision @ (shared - prior.mean)
    for weights, diffs in zip(personal, signed_diffs, strict=True):
        total -= 0.5 * prior.personal_precision * np.sum((weights - shared) ** 2)
        total += np.log(lapse / 2 + (1 - lapse) / (1 + np.exp(-diffs @ weights))).sum()
    return total


def as_vector(weights):
    return np.concatenate([weights.shared, weights.personal.ravel()])


def dense_covariance(prior, signed_diffs, mode):
    """Inverse of the Hessian by second differences."""
    n, step = len(mode), 1e-4
    steps = step * np.eye(n)
    hessian = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            corners = [
                si * sj * log_posterior(mode + si * steps[i] + sj * steps[j], prior, signed_diffs)
                for si in (1, -1)
                for sj in (1, -1)
            ]
            hessian[i, j] = -sum(corners) / (4 * step**2)
    return np.linalg.inv(hessian), np.linalg.slogdet(hessian)[1]


def test_the_mode_is_where_a_general_optimiser_ends():
    prior, answers = some_prior(), some_answers(0)
    posterior = approximate(prior, answers)
    found = minimize(lambda v: -log_posterior(v, prior, answers), np.zeros((N_PEOPLE + 1) * K), tol=1e-10)
    np.testing.assert_allclose(as_vector(posterior.mode), found.x, atol=1e-4)
    assert posterior.has_converged


def test_the_slope_at_the_mode_is_nothing():
    prior, answers = some_prior(), some_answers(1)
    mode = as_vector(approximate(prior, answers).mode)
    np.testing.assert_allclose(approx_fprime(mode, log_posterior, 1e-6, prior, answers), 0.0, atol=1e-4)


def test_the_inverse_hessian_is_that_of_second_differences():
    prior, answers = some_prior(), some_answers(2)
    posterior = approximate(prior, answers)
    dense, log_determinant = dense_covariance(prior, answers, as_vector(posterior.mode))
    assert_blocks(posterior.inverse_hessian, dense, 1e-6)
    assert posterior.inverse_hessian.log_determinant == pytest.approx(log_determinant, abs=1e-5)


def test_the_covariance_is_the_inverse_of_prior_and_information():
    """Written as one dense matrix: prior precision, plus each answer's curvature where it bends down."""
    prior, answers = some_prior(), some_answers(2)
    posterior = approximate(prior, answers)
    tau, size = prior.personal_precision, (N_PEOPLE + 1) * K
    lapse = expit(prior.lapse_logit)
    precision = np.zeros((size, size))
    precision[:K, :K] = prior.precision + N_PEOPLE * tau * np.eye(K)
    for u in range(N_PEOPLE):
        rows = slice(K * (u + 1), K * (u + 2))
        precision[rows, :K] = precision[:K, rows] = -tau * np.eye(K)
        precision[rows, rows] = tau * np.eye(K)
        for row in answers[u]:
            log_p = [
                np.log(lapse / 2 + (1 - lapse) * expit(row @ posterior.mode.personal[u] + step))
                for step in (-1e-4, 0.0, 1e-4)
            ]
            information = max(0.0, -(log_p[0] - 2 * log_p[1] + log_p[2]) / 1e-8)
            precision[rows, rows] += information * np.outer(row, row)
    assert_blocks(posterior.covariances, np.linalg.inv(precision), 1e-6)
    assert posterior.covariances.log_determinant == pytest.approx(np.linalg.slogdet(precision)[1], abs=1e-5)


def assert_blocks(covariances, dense, tolerance):
    """The blocks, and a product with any vector, are those of the dense matrix."""
    np.testing.assert_allclose(covariances.shared, dense[:K, :K], atol=tolerance)
    for u in range(N_PEOPLE):
        rows = slice(K * (u + 1), K * (u + 2))
        own, cross = dense[rows, rows], dense[rows, :K]
        np.testing.assert_allclose(covariances.personal[u], own, atol=tolerance)
        deviation = own + dense[:K, :K] - cross - cross.T
        np.testing.assert_allclose(covariances.deviations[u], deviation, atol=tolerance)
    rng = np.random.default_rng(0)
    vector = Weights(rng.normal(size=K), rng.normal(size=(N_PEOPLE, K)))
    found = as_vector(covariances.times(vector))
    np.testing.assert_allclose(found, dense @ as_vector(vector), atol=10 * tolerance)


def test_the_log_density_is_that_of_the_mode_beside_a_coins():
    prior, answers = some_prior(), some_answers(4)
    posterior = approximate(prior, answers)
    coins = answers[..., 0].size * np.log(0.5)
    expected = log_posterior(as_vector(posterior.mode), prior, answers) - coins
    assert posterior.log_density == pytest.approx(expected, abs=1e-9)


@pytest.mark.statistical
def test_in_low_dimension_it_is_close_to_importance_sampling():
    """One weight and two people: the exact posterior of the three unknowns, from a wide proposal."""
    prior, answers = some_prior(k=1), some_answers(5, n_people=2, n=60, k=1)
    posterior = approximate(prior, answers)
    proposal = multivariate_t(as_vector(posterior.mode), 0.3 * (np.eye(3) + np.ones((3, 3))), df=4)
    draws = proposal.rvs(20_000, random_state=np.random.default_rng(1))
    log_ratios = np.array([log_posterior(draw, prior, answers) for draw in draws]) - proposal.logpdf(draws)
    shares = np.exp(log_ratios - log_ratios.max())
    shares /= shares.sum()
    assert 1 / (shares**2).sum() > 3000
    mean = shares @ draws
    deviations = np.sqrt(shares @ (draws - mean) ** 2)
    variances = [posterior.covariances.shared[0, 0], *posterior.covariances.personal[:, 0, 0]]
    # The posterior leans towards larger weights, which no normal distribution around its mode can say.
    np.testing.assert_allclose(as_vector(posterior.mode), mean, atol=0.3 * deviations.min())
    np.testing.assert_allclose(np.sqrt(variances), deviations, rtol=0.15)
    # For what it is used for, that hardly matters.
    diffs = np.linspace(-3.0, 3.0, 13)
    for u in range(2):
        exact = np.array(
            [shares @ np.exp(log_likelihood(d * draws[:, 1 + u], prior.lapse_logit).value) for d in diffs]
        )
        known = posterior.of_person(u)
        found = probability(diffs * known.mean[0], diffs**2 * known.covariance[0, 0], prior.lapse_logit)
        np.testing.assert_allclose(found, exact, atol=0.02)


def test_rows_of_zeros_say_nothing():
    prior, answers = some_prior(), some_answers(6)
    padded = np.concatenate([answers, np.zeros((N_PEOPLE, 5, K))], axis=1)
    one, other = approximate(prior, answers), approximate(prior, padded)
    np.testing.assert_allclose(as_vector(one.mode), as_vector(other.mode), atol=1e-12)
    np.testing.assert_allclose(one.covariances.personal, other.covariances.personal, atol=1e-12)
    assert one.log_density == pytest.approx(other.log_density, abs=1e-10)


def test_without_answers_the_prior_comes_back():
    prior = some_prior()
    posterior = approximate(prior, np.zeros((1, 0, K)))
    covariance = np.linalg.inv(prior.precision)
    np.testing.assert_allclose(posterior.of_shared().covariance, covariance, atol=1e-12)
    found = posterior.of_person(0)
    np.testing.assert_allclose(found.mean, prior.mean, atol=1e-12)
    np.testing.assert_allclose(
        found.covariance, covariance + np.eye(K) / prior.personal_precision, atol=1e-12
    )


def test_answers_against_all_odds_are_climbed_over():
    """From a start at which most answers look like lapses, where the Hessian isn't definite."""
    prior, answers = some_prior(personal_precision=0.01, lapse_logit=-3.0), some_answers(7, n=60)
    wrong = Weights(np.array([-4.0, 0.0]), np.tile([-4.0, 0.0], (N_PEOPLE, 1)))
    z = (answers @ wrong.personal[:, :, None])[..., 0]
    told = answers.transpose(0, 2, 1) @ (-log_likelihood(z, -3.0).curvature[..., None] * answers)
    assert np.linalg.eigvalsh(told).min() < -0.1
    posterior = approximate(prior, answers, wrong)
    assert posterior.has_converged
    right = approximate(prior, answers)
    assert posterior.log_density == pytest.approx(right.log_density, abs=1e-6)


def test_giving_up_early_is_told(monkeypatch):
    monkeypatch.setattr(laplace, "_MOST_STEPS", 1)
    assert not approximate(some_prior(), some_answers(8)).has_converged
