"""What is said of a network is what it was trained to say: checked against the compiled kernels."""

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.evaluation.learned import learned_feature, learned_reward
from study_core.networks.config import NetworkConfig
from study_core.networks.model import initial_networks
from study_core.predictors.personal_network import NetworkModel
from study_core.predictors.predictor import Pairs


def model_of(config):
    rngs = [np.random.default_rng(k) for k in range(2)]
    weights = np.array([0.5, 0.2, 0.3, 0.9]) if config.has_hand_coded else np.empty(0)
    networks = initial_networks(rngs, len(config.inputs), config.n_hidden, config.n_features, weights)
    networks.output_biases[:] = 0.1
    return NetworkModel(DRIVING_V1, config, networks)


@pytest.mark.parametrize("config", [NetworkConfig(), NetworkConfig(n_features=2, has_hand_coded=False)])
def test_differences_of_rewards_are_the_log_odds_of_the_best_network(config):
    model = model_of(config)
    states = DRIVING_V1.rollout(np.random.default_rng(3).uniform(-1.0, 1.0, (12, 10)))
    pairs = Pairs(states[:6], states[6:])
    likely = model.members_probability_of_a(pairs)[0]
    rewards = learned_reward(model)(states)
    np.testing.assert_allclose(rewards[:6] - rewards[6:], np.log(likely / (1.0 - likely)), atol=1e-3)


def test_a_feature_is_the_first_output_of_the_best_network():
    model = model_of(NetworkConfig(n_features=2))
    inputs = np.random.default_rng(4).normal(size=(5, 4))
    best = model.networks
    hidden = np.maximum(inputs @ best.hidden_weights[0].T + best.hidden_biases[0], 0.0)
    expected = np.tanh(hidden @ best.output_weights[0, 0] + best.output_biases[0, 0])
    np.testing.assert_allclose(learned_feature(model)(inputs), expected, rtol=1e-5)
