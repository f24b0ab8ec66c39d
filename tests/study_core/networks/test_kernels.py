"""The compiled loss, gradient and training against torch: its autograd and its NAdam, in double precision."""

import numpy as np
import pytest
import torch

from study_core.networks import kernels
from study_core.networks.config import NetworkConfig
from study_core.networks.model import initial_networks
from study_core.networks.training import train
from tests.study_core.networks.people import random_lesson, torch_loss, torch_parameters

CASES = {
    "the paper's": {},
    "no hand-coded features": {"n_hand_coded": 0},
    "five inputs": {"n_inputs": 5},
    "one input": {"n_inputs": 1},
    "nine inputs": {"n_inputs": 9},
    "lapses and a base": {"lapse_rate": 0.2, "base": 3.0},
    "more pairs than fit a chunk": {"n": 30, "n_steps": 50},
    "steps that fill a chunk alone": {"n": 3, "n_steps": 1500},
}


def networks_for(lesson, n_features, n=1, seed=1):
    rngs = np.random.default_rng(seed).spawn(n)
    n_inputs = lesson.pairs.inputs_a.shape[2]
    return initial_networks(rngs, n_inputs, 11, n_features, lesson.hand_coded_weights)


def gradient_of(lesson, networks):
    packed = networks.packed[0]
    gradient = np.empty_like(packed)
    pairs = lesson.pairs
    examples = (
        pairs.packed_inputs,
        pairs.inputs_a.shape[1],
        pairs.hand_coded_diffs,
        lesson.signs,
        pairs.base_logits,
        lesson.lapse_rate,
    )
    loss = kernels.loss_and_gradient(
        networks.kernel_shape, examples, (packed, networks.linear_weights[0]), gradient
    )
    return loss, networks.unpacked(gradient[None], networks.linear_weights)


@pytest.mark.parametrize("n_features", [1, 2])
@pytest.mark.parametrize("case", CASES)
def test_loss_and_gradient_are_those_of_automatic_differentiation(case, n_features):
    lesson = random_lesson(3, **CASES[case])
    networks = networks_for(lesson, n_features)
    # Biases too, or a wrong one would not show.
    networks.hidden_biases[:] = np.random.default_rng(4).normal(0, 0.3, networks.hidden_biases.shape)
    networks.output_biases[:] = 0.2
    parameters = torch_parameters(networks)
    expected = torch_loss(lesson, parameters)
    expected.backward()
    loss, gradient = gradient_of(lesson, networks)
    assert loss == pytest.approx(expected.item(), rel=1e-4)
    for ours, theirs in zip(
        (gradient.hidden_weights, gradient.hidden_biases, gradient.output_weights, gradient.output_biases),
        parameters,
        strict=False,
    ):
        slopes = theirs.grad.numpy()
        np.testing.assert_allclose(ours[0], slopes, rtol=1e-3, atol=1e-3 * np.abs(slopes).max())


@pytest.mark.parametrize("weight_decay", [0.0, 0.5])
@pytest.mark.parametrize(("n_features", "n_hand_coded"), [(1, 4), (2, 4), (1, 0)])
def test_training_is_torchs_nadam_with_gradient_steps_of_the_linear_weights(
    n_features, n_hand_coded, weight_decay
):
    lesson = random_lesson(5, n_hand_coded=n_hand_coded)
    config = NetworkConfig(
        n_features=n_features,
        n_hidden=11,
        n_trials=2,
        n_selected=2,
        training_share=1.0,
        n_epochs=25,
        epochs_per_linear_update=10,
        weight_decay=weight_decay,
    )
    trials = train(np.random.default_rng(1), config, lesson)
    for trial in range(2):
        parameters = torch_parameters(networks_for(lesson, n_features, n=2), trial)
        optimiser = torch.optim.NAdam(parameters[:4], lr=0.001, betas=(0.9, 0.999), weight_decay=weight_decay)
        curve = []
        for epoch in range(25):
            optimiser.zero_grad()
            loss = torch_loss(lesson, parameters)
            loss.backward()
            optimiser.step()
            curve.append(loss.item())
            for _ in range(5 if epoch + 1 in (10, 20) else 0):
                (slope,) = torch.autograd.grad(torch_loss(lesson, parameters), parameters[4])
                parameters[4].data -= 0.005 * slope
        np.testing.assert_allclose(trials.losses[trial], curve, rtol=0, atol=1e-4)
        np.testing.assert_allclose(
            trials.networks.linear_weights[trial], parameters[4].detach(), rtol=0, atol=1e-5
        )
        np.testing.assert_allclose(
            trials.networks.output_weights[trial], parameters[2].detach(), rtol=0, atol=1e-3
        )


def test_the_feature_of_one_step_is_the_tanh_to_a_float32s_precision():
    values = np.concatenate([np.linspace(-30, 30, 4001), [0.0, 1e-8, -1e-8, 1e-4]]).astype(np.float32)
    computed = values.copy()
    kernels._tanh(computed)
    np.testing.assert_allclose(computed, np.tanh(values.astype(np.float64)), rtol=2e-7, atol=1e-14)


@pytest.mark.parametrize("lapse_rate", [0.0, 0.1])
def test_no_margin_overflows(lapse_rate):
    margins = np.array([-1e4, -750.0, -1.0, 0.0, 2.0, 1e4])
    losses = kernels.losses_of(margins, np.ones(6), lapse_rate)
    with np.errstate(divide="ignore"):
        log_lapsed = np.log(lapse_rate / 2.0)
    expected = -np.logaddexp(log_lapsed, np.log1p(-lapse_rate) - np.logaddexp(0.0, -margins))
    np.testing.assert_allclose(losses, expected, rtol=1e-12, atol=1e-15)
    turned = kernels.losses_of(-margins, -np.ones(6), lapse_rate)
    np.testing.assert_array_equal(turned, losses)
