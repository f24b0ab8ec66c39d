"""Information gain against its definition summed term by term, and its slope against differences of it."""

import math

import numpy as np
import pytest

from study_core.acquisition.information_gain import information_gains, rank_pairs
from study_core.domains.driving import DRIVING_V1
from tests.study_core import references
from tests.study_core.acquisition.made_up import posterior_of, situation_of, varied_posterior


def sigmoid(u):
    return 1.0 / (1.0 + math.exp(-u)) if u >= 0 else math.exp(u) / (1.0 + math.exp(u))


def answer_probabilities(utility, lapse_rate, threshold):
    """Returns P(A), P(B) and, with a threshold, P(about the same), by Rao and Kupper with lapses."""
    a, b = sigmoid(utility - threshold), sigmoid(-utility - threshold)
    chosen = [a, b] if threshold == 0.0 else [a, b, 1.0 - a - b]
    return [lapse_rate / len(chosen) + (1.0 - lapse_rate) * p for p in chosen]


def entropy(probabilities):
    return -math.fsum(p * math.log(p) for p in probabilities if p > 0.0)


def gain(posterior, psi):
    """Returns H(mean p) - mean H(p)."""
    rows = zip(
        posterior.samples,
        posterior.parameters.rationality,
        posterior.parameters.lapse_rate,
        posterior.parameters.tie_threshold,
        strict=True,
    )
    answers = [answer_probabilities(float(beta * (w @ psi)), lapse, tie) for w, beta, lapse, tie in rows]
    mean = [math.fsum(column) / len(answers) for column in zip(*answers, strict=True)]
    return entropy(mean) - math.fsum(map(entropy, answers)) / len(answers)


@pytest.mark.parametrize("with_ties", [False, True])
def test_the_gain_is_the_entropy_that_an_answer_is_expected_to_remove(with_ties):
    posterior = varied_posterior(23, with_ties)
    psis = np.random.default_rng(1).normal(0.0, 0.05, (12, 4))
    gains, _ = information_gains(posterior, psis)
    np.testing.assert_allclose(gains, [gain(posterior, psi) for psi in psis], rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("with_ties", [False, True])
def test_its_slope_is_what_a_small_step_changes(with_ties):
    posterior = varied_posterior(23, with_ties)
    psis = np.random.default_rng(2).normal(0.0, 0.02, (6, 4))
    _, slopes = information_gains(posterior, psis)
    for psi, slope in zip(psis, slopes, strict=True):
        for k, step in enumerate(1e-6 * np.eye(4)):
            change = (gain(posterior, psi + step) - gain(posterior, psi - step)) / 2e-6
            assert slope[k] == pytest.approx(change, rel=1e-5, abs=1e-7)


def test_equal_drives_say_nothing_and_certain_samples_neither():
    posterior = posterior_of(np.eye(4), 1e5, 0.0)
    gains, _ = information_gains(posterior, np.array([[0.0] * 4, [1.0] * 4]))
    np.testing.assert_allclose(gains, 0.0, atol=1e-15)


def test_samples_that_are_certain_of_opposite_answers_are_worth_one_bit():
    posterior = posterior_of(np.eye(2), 1e5, 0.0)
    gains, _ = information_gains(posterior, np.array([[1.0, -1.0]]))
    assert gains[0] == pytest.approx(math.log(2.0), rel=1e-12)


def test_each_samples_own_rationality_counts():
    """Two samples that want the same, one of them careless: an answer tells how careless, and that is counted."""
    both = np.array([[1.0, 0.0], [1.0, 0.0]])
    alike, unlike = posterior_of(both, [50.0, 50.0], 0.0), posterior_of(both, [50.0, 0.01], 0.0)
    psi = np.array([[0.1, 0.0]])
    assert information_gains(alike, psi)[0][0] == pytest.approx(0.0, abs=1e-15)
    assert information_gains(unlike, psi)[0][0] > 0.1


def test_the_pairs_found_are_worth_what_is_said_and_more_than_where_the_climbs_began():
    posterior = varied_posterior(40, False)
    ranked = rank_pairs(np.random.default_rng(5), situation_of(posterior), 10)
    psis = [
        np.subtract(*(references.features(references.drive(references.ROBOT_START, c)) for c in pair))
        for pair in ranked.controls
    ]
    np.testing.assert_allclose(ranked.scores, [gain(posterior, psi) for psi in psis], rtol=1e-6)
    anywhere = np.random.default_rng(6).uniform(-1.0, 1.0, (200, 2, 10))
    features = DRIVING_V1.features(DRIVING_V1.rollout(anywhere.reshape(-1, 10))).reshape(200, 2, 4)
    random_gains, _ = information_gains(posterior, features[:, 0] - features[:, 1])
    assert ranked.scores[0] > random_gains.max()
    assert ranked.weights is None
