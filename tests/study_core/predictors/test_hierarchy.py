"""What people have in common: known truths come back, and the evidence agrees with brute force."""

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import norm

from study_core.predictors.hierarchy import learn_person, learn_population, log_evidence
from study_core.predictors.lapsing import probability
from tests.study_core.predictors.simulated import (
    LAPSE_RATE,
    PERSONAL_SCALE,
    SHARED,
    crowd,
    personal_weights,
    signed_diffs,
)

K = len(SHARED)


def exact_log_evidence(shared_scale, personal_scale, lapse_rate, people):
    """One weight, integrated on a grid: every person's own given the shared one, then the shared one."""
    grid = np.linspace(-8.0, 8.0, 1601)
    width = grid[1] - grid[0]
    log_likelihoods = [
        np.log(lapse_rate / 2 + (1 - lapse_rate) * expit(np.outer(grid, diffs[:, 0]))).sum(axis=1)
        for diffs in people
    ]
    near = norm.pdf(grid[:, None], grid, personal_scale) * width
    given_shared = np.prod([near.T @ np.exp(one) for one in log_likelihoods], axis=0)
    return np.log(np.sum(norm.pdf(grid, 0.0, shared_scale) * given_shared) * width)


def log_loss(population, weights, diffs):
    spread = ((diffs @ weights.covariance) * diffs).sum(axis=1)
    return -np.log(probability(diffs @ weights.mean, spread, population.lapse_logit)).mean()


@pytest.mark.parametrize("scales", [(0.5, 0.3), (1.5, 0.8)])
@pytest.mark.parametrize("lapse_rate", [0.02, 0.2])
def test_in_one_dimension_the_evidence_is_that_of_a_grid(scales, lapse_rate):
    _, people = crowd(0, 3, 30, shared=np.array([1.0]))
    hyperparameters = np.array([*np.log(scales), np.log(lapse_rate / (1 - lapse_rate))])
    found, _, _ = log_evidence(hyperparameters, np.stack(people))
    coins = 3 * 30 * np.log(0.5)
    assert found + coins == pytest.approx(exact_log_evidence(*scales, lapse_rate, people), abs=0.15)


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_of_the_evidence_is_a_finite_difference(seed):
    rng = np.random.default_rng(seed)
    people = np.stack(crowd(seed, 4, 25)[1])
    hyperparameters = np.array([-0.5, -1.0, -2.0]) + rng.normal(0.0, 0.5, 3)
    _, gradient, _ = log_evidence(hyperparameters, people)
    step = 1e-4
    expected = [
        (log_evidence(hyperparameters + move, people)[0] - log_evidence(hyperparameters - move, people)[0])
        / (2 * step)
        for move in step * np.eye(3)
    ]
    np.testing.assert_allclose(gradient, expected, atol=1e-5)


def test_no_scales_nearby_are_more_likely():
    _, people = crowd(1, 8, 40)
    population, _ = learn_population(people)
    best = np.array(
        [np.log(population.shared_scale), np.log(population.personal_scale), population.lapse_logit]
    )
    expected = np.array([np.log(0.3), np.log(0.15), -3.0])

    def log_posterior(hyperparameters):
        return (
            log_evidence(hyperparameters, np.stack(people))[0] - ((hyperparameters - expected) ** 2).sum() / 2
        )

    assert population.has_converged
    assert population.log_evidence == pytest.approx(log_evidence(best, np.stack(people))[0], abs=1e-9)
    for move in 0.1 * np.vstack([np.eye(3), -np.eye(3)]):
        assert log_posterior(best + move) < log_posterior(best)


@pytest.mark.statistical
def test_known_people_are_recovered():
    """Scales and lapse rate come back; of the true weights, nine in ten lie in the intervals that hold nine in ten."""
    weights, people = crowd(2, 60, 250)
    population, beliefs = learn_population(people)
    assert population.has_converged
    assert population.personal_scale == pytest.approx(PERSONAL_SCALE, rel=0.2)
    assert expit(population.lapse_logit) == pytest.approx(LAPSE_RATE, abs=0.03)
    assert population.shared_scale == pytest.approx(np.sqrt(np.mean(SHARED**2)), rel=0.5)
    deviations = np.sqrt(np.diag(population.shared.covariance))
    assert (np.abs(population.shared.mean - SHARED) < 4 * deviations).all()
    means = np.array([belief.mean for belief in beliefs])
    spreads = np.sqrt([np.diag(belief.covariance) for belief in beliefs])
    covered = np.mean(np.abs(weights - means) < norm.ppf(0.95) * spreads)
    assert 0.85 < covered < 0.95


def test_somebody_who_has_not_answered_is_the_population_and_its_spread():
    _, people = crowd(3, 6, 30)
    population, _ = learn_population(people)
    found = learn_person(population, np.zeros((0, K)))
    np.testing.assert_allclose(found.mean, population.shared.mean, atol=1e-10)
    covariance = population.shared.covariance + population.personal_scale**2 * np.eye(K)
    np.testing.assert_allclose(found.covariance, covariance, atol=1e-10)


def test_somebody_added_later_is_known_almost_as_if_they_had_been_there():
    _, people = crowd(4, 12, 60)
    _, together = learn_population(people)
    population, _ = learn_population(people[:-1])
    later = learn_person(population, people[-1])
    spread = np.sqrt(np.diag(together[-1].covariance))
    np.testing.assert_allclose(later.mean, together[-1].mean, atol=0.3 * spread.min())
    np.testing.assert_allclose(np.sqrt(np.diag(later.covariance)), spread, rtol=0.15)


@pytest.mark.statistical
def test_the_more_people_are_known_the_better_somebody_new_is_predicted():
    rng = np.random.default_rng(5)
    _, people = crowd(6, 40, 30)
    newcomers = personal_weights(rng, 30)
    own = [signed_diffs(rng, one, 5) for one in newcomers]
    later = [signed_diffs(rng, one, 200) for one in newcomers]
    losses = []
    for n_people in (1, 5, 40):
        population, _ = learn_population(people[:n_people])
        losses.append(
            np.mean(
                [
                    log_loss(population, learn_person(population, few), rest)
                    for few, rest in zip(own, later, strict=True)
                ]
            )
        )
    assert losses[0] > losses[1] + 0.01 > losses[2] + 0.01


@pytest.mark.statistical
def test_own_answers_help_beyond_the_population():
    rng = np.random.default_rng(7)
    population, _ = learn_population(crowd(8, 30, 30)[1])
    newcomers = personal_weights(rng, 20)
    answers = [signed_diffs(rng, one, 300) for one in newcomers]
    losses = [
        np.mean([log_loss(population, learn_person(population, one[:n]), one[100:]) for one in answers])
        for n in (0, 20, 100)
    ]
    assert losses[0] > losses[1] > losses[2]


def test_a_feature_that_never_differs_drops_out():
    _, people = crowd(9, 5, 30)
    population, beliefs = learn_population(people)
    with_constant, beliefs_with = learn_population([np.insert(diffs, 2, 0.0, axis=1) for diffs in people])
    assert with_constant.log_evidence == pytest.approx(population.log_evidence, abs=1e-6)
    assert with_constant.shared_scale == pytest.approx(population.shared_scale, rel=1e-3)
    kept = [0, 1, 3, 4, 5]
    for one, other in zip(beliefs, beliefs_with, strict=True):
        np.testing.assert_allclose(other.mean[kept], one.mean, atol=1e-3)
        np.testing.assert_allclose(other.covariance[np.ix_(kept, kept)], one.covariance, atol=1e-3)
        assert other.mean[2] == 0.0


def test_people_may_have_answered_more_or_less():
    """Somebody without an answer among them is like somebody new."""
    _, people = crowd(10, 5, 30)
    uneven = [people[0][:7], people[1], np.zeros((0, K)), people[3][:20], people[4]]
    population, beliefs = learn_population(uneven)
    assert population.has_converged
    covariance = population.shared.covariance + population.personal_scale**2 * np.eye(K)
    np.testing.assert_allclose(beliefs[2].covariance, covariance, atol=1e-10)
    np.testing.assert_allclose(beliefs[2].mean, population.shared.mean, atol=1e-10)


def test_everybody_alike_and_certain_stays_finite():
    """No lapses, no noise and no differences: scales at the edge of what is looked for are still numbers."""
    rng = np.random.default_rng(11)
    diffs = rng.normal(size=(4, 60, K))
    people = list(diffs * np.sign(diffs[..., :1]))
    population, beliefs = learn_population(people)
    assert np.isfinite(population.log_evidence)
    assert all(np.linalg.eigvalsh(belief.covariance).min() > 0 for belief in beliefs)
    assert population.shared.mean[0] > 5 * np.abs(population.shared.mean[1:]).max()
