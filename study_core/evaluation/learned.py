"""What a person's network has learned, as functions that figures and optimisers can ask."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from study_core.predictors.personal_network import NetworkModel

FeatureFn = Callable[[Float[np.ndarray, "n n_inputs"]], Float[np.ndarray, " n"]]
"""A learned feature: takes the inputs of single steps, gives the feature of each."""

RewardFn = Callable[[Float[np.ndarray, "n n_steps n_states"]], Float[np.ndarray, " n"]]
"""The reward of whole trajectories."""


def learned_feature(model: NetworkModel) -> FeatureFn:
    """Returns the first learned feature of the network that was best on validation."""
    best = model.networks[:1]
    return lambda inputs: best.step_features(inputs)[0, :, 0].astype(np.float64)


def learned_reward(model: NetworkModel) -> RewardFn:
    """Returns the reward that the best network and its linear weights make up: log-odds are its differences."""
    domain, config, best = model.domain, model.config, model.networks[:1]
    n_learned = best.output_biases.shape[1]
    weights = best.linear_weights[0]

    def reward(states: Float[np.ndarray, "n n_steps n_states"]) -> Float[np.ndarray, " n"]:
        n, n_steps = states.shape[:2]
        inputs = config.inputs_of(domain, states)
        learned = best.step_features(inputs.reshape(n * n_steps, -1))[0].reshape(n, n_steps, -1).sum(axis=1)
        total = learned.astype(np.float64) @ weights[-n_learned:]
        return total + domain.features(states) @ weights[:-n_learned] if config.has_hand_coded else total

    return reward
