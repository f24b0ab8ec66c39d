"""The published training written plainly in torch: one trial after the other, full batches, autograd."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import nn

from study_core.networks.config import NetworkConfig
from study_core.networks.model import Networks
from study_core.networks.training import Lesson


def train_in_turns(
    config: NetworkConfig, lesson: Lesson, starts: Networks, n_threads: int
) -> Float[np.ndarray, "n_trials n_epochs"]:
    """Trains networks from given starts, on all answers of a lesson.

    Args:
        config: The training; one learned feature beside the hand-coded ones.
        lesson: The answers that train.
        starts: One untrained network for each trial.
        n_threads: Threads that torch may use.

    Returns:
        Each trial's loss at the start of each epoch.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(n_threads)
    try:
        return np.array([_train(config, lesson, starts, trial) for trial in range(len(starts))])
    finally:
        torch.set_num_threads(before)


def _train(config: NetworkConfig, lesson: Lesson, starts: Networks, trial: int) -> list[float]:
    network = _network(starts, trial)
    linear = _tensor(starts.linear_weights[trial]).requires_grad_()
    inputs_a, inputs_b = _tensor(lesson.pairs.inputs_a), _tensor(lesson.pairs.inputs_b)
    hand_coded, signs = _tensor(lesson.pairs.hand_coded_diffs), _tensor(lesson.signs)

    def loss() -> torch.Tensor:
        learned = network(inputs_a).sum(dim=1) - network(inputs_b).sum(dim=1)
        logits = torch.cat([hand_coded, learned], dim=1) @ linear
        return nn.functional.softplus(-signs * logits).mean()

    optimiser = torch.optim.NAdam(network.parameters(), lr=config.learning_rate, betas=config.betas)
    of_linear = torch.optim.SGD([linear], lr=config.linear_rate)
    curve = []
    for epoch in range(config.n_epochs):
        curve.append(_step(optimiser, loss()))
        if (epoch + 1) % config.epochs_per_linear_update == 0:
            for _ in range(config.n_linear_steps):
                _step(of_linear, loss())
    return curve


def _step(optimiser: torch.optim.Optimizer, loss: torch.Tensor) -> float:
    optimiser.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    optimiser.step()
    return loss.item()


def _network(starts: Networks, trial: int) -> nn.Sequential:
    _, n_hidden, n_inputs = starts.hidden_weights.shape
    network = nn.Sequential(
        nn.Linear(n_inputs, n_hidden),
        nn.ReLU(),
        nn.Linear(n_hidden, starts.output_biases.shape[1]),
        nn.Tanh(),
    )
    arrays = (starts.hidden_weights, starts.hidden_biases, starts.output_weights, starts.output_biases)
    with torch.no_grad():
        for parameter, array in zip(network.parameters(), arrays, strict=True):
            parameter.copy_(torch.from_numpy(array[trial]))
    return network


def _tensor(values: np.ndarray) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float32)
