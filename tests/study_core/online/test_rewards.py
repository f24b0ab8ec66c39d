"""A domain with a learned feature keeps the contract; answers are graded by networks that don't know them."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.domain import Domain
from study_core.online.feature import N_FOLDS
from study_core.online.learn import learn_feature
from tests.study_core.online.simulated import STUDY, answers

KNOWN = answers(20, seed=3)
FEATURE = learn_feature(STUDY, 2, 20, KNOWN)
KNOWING = STUDY.knowing(replace(STUDY.knowledge, feature=FEATURE))
DOMAIN = KNOWING.rewards.domain


def plain_feature(states, rows):
    """The feature by its formula alone: w tanh(V relu(U x + b) + c), summed over the steps; the mean of networks."""
    networks = FEATURE.checkpoint.networks
    inputs = FEATURE.checkpoint.config.inputs_of(STUDY.domain, states)
    total = np.zeros(len(states))
    for row in rows:
        hidden = np.maximum(inputs @ networks.hidden_weights[row].T + networks.hidden_biases[row], 0.0)
        outputs = np.tanh(hidden @ networks.output_weights[row].T + networks.output_biases[row])
        total += (outputs @ networks.linear_weights[row]).sum(axis=1)
    return total / len(rows)


def test_it_is_a_domain_whose_rewards_are_those_of_its_features():
    assert isinstance(DOMAIN, Domain)
    rng = np.random.default_rng(1)
    controls = rng.uniform(DOMAIN.control_lower, DOMAIN.control_upper, (30, 10))
    weights = rng.uniform(0.1, 1.0, (30, 5))
    rewards, _ = DOMAIN.reward_and_gradient(controls, weights)
    expected = (DOMAIN.features(DOMAIN.rollout(controls)) * weights).sum(axis=1)
    # Features come in single precision, rewards to climb on in double.
    np.testing.assert_allclose(rewards, expected, atol=1e-6)
    assert DOMAIN.feature_names == (*STUDY.domain.feature_names, "learned")


def test_the_feature_is_the_mean_of_all_networks_up_to_a_constant():
    states = STUDY.domain.rollout(STUDY.bank.controls[:40])
    every = plain_feature(states, range(len(FEATURE.checkpoint.networks)))
    found = DOMAIN.features(states)
    np.testing.assert_allclose(np.diff(found[:, -1]), np.diff(every), atol=1e-5)
    np.testing.assert_array_equal(found[:, :-1], STUDY.domain.features(states))


def test_the_gradient_is_that_of_the_reward():
    rng = np.random.default_rng(8)
    controls = rng.uniform(DOMAIN.control_lower, DOMAIN.control_upper, (3, 10)) * 0.9
    weights = rng.uniform(0.1, 1.0, (3, 5))
    _, gradients = DOMAIN.reward_and_gradient(controls, weights)
    for k in range(10):
        step = np.zeros(10)
        step[k] = 1e-6
        above, _ = DOMAIN.reward_and_gradient(controls + step, weights)
        below, _ = DOMAIN.reward_and_gradient(controls - step, weights)
        np.testing.assert_allclose(gradients[:, k], (above - below) / 2e-6, atol=2e-5)


def test_an_answer_that_taught_it_is_graded_by_networks_that_do_not_know_it():
    more = answers(26, seed=3)
    diffs = FEATURE.added_to(STUDY.domain, more).feature_diffs
    states_a, states_b = (STUDY.domain.rollout(more.controls[:, which]) for which in (0, 1))
    n_networks = len(FEATURE.checkpoint.networks)
    for i in range(26):
        rows = [row for row in range(n_networks) if i >= 20 or row // (n_networks // N_FOLDS) == i % N_FOLDS]
        expected = plain_feature(states_a[i : i + 1], rows) - plain_feature(states_b[i : i + 1], rows)
        assert diffs[i, -1] == pytest.approx(expected[0], abs=1e-5)
    np.testing.assert_array_equal(diffs[:, :-1], more.comparisons.feature_diffs)


def test_the_bank_has_the_feature_of_every_drive_and_the_features_own_drives():
    bank, base = KNOWING.rewards.bank, STUDY.bank
    assert len(bank.controls) == len(base.controls) + len(FEATURE.drives)
    np.testing.assert_array_equal(bank.controls[: len(base.controls)], base.controls)
    np.testing.assert_allclose(bank.features, DOMAIN.features(DOMAIN.rollout(bank.controls)), atol=1e-6)
    assert bank.paths.shape[0] == bank.weights.shape[0] == len(bank.controls)
    assert not bank.weights[: len(base.controls), -1].any()


def test_a_study_that_knows_nothing_runs_over_its_hand_coded_features():
    assert STUDY.rewards.domain is STUDY.domain
    assert STUDY.rewards.prior == STUDY.prior
    assert KNOWING.rewards.prior.n_features == STUDY.prior.n_features + 1
