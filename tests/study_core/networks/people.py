"""People whose taste is known, and a plain network in float64 to compare with."""

import numpy as np
import torch

from study_core.domains.driving import DRIVING_V1
from study_core.networks.model import Examples, Networks
from study_core.networks.training import Lesson
from study_core.predictors.predictor import Pairs, Training

STORED_MEAN = np.array([0.4, 0.2, 0.4, 0.3])


def pairs(seed, n):
    controls = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, n, 10))
    return Pairs(DRIVING_V1.rollout(controls[0]), DRIVING_V1.rollout(controls[1]))


def keeps_left(seed, n, stored_mean=STORED_MEAN):
    """Somebody who prefers the drive that is further left, which no hand-coded feature says."""
    compared = pairs(seed, n)
    further_left = compared.states_b[..., 0].mean(axis=1) - compared.states_a[..., 0].mean(axis=1)
    return Training(compared, np.sign(further_left), stored_mean)


def random_lesson(seed, n=12, n_steps=7, n_inputs=4, n_hand_coded=4, lapse_rate=0.0, base=0.0):
    rng = np.random.default_rng(seed)
    examples = Examples(
        rng.normal(size=(n, n_steps, n_inputs)),
        rng.normal(size=(n, n_steps, n_inputs)),
        rng.normal(size=(n, n_hand_coded)),
        base * rng.normal(size=n),
    )
    return Lesson(examples, rng.choice([-1.0, 1.0], n), rng.random(n_hand_coded), lapse_rate)


def torch_parameters(networks: Networks, which=0):
    """U, b, V, c and w of one network, as tensors that want gradients."""
    arrays = (
        networks.hidden_weights,
        networks.hidden_biases,
        networks.output_weights,
        networks.output_biases,
        networks.linear_weights,
    )
    return [torch.tensor(array[which], dtype=torch.float64, requires_grad=True) for array in arrays]


def torch_loss(lesson: Lesson, parameters):
    """Mean of -log P(answer), as the formula reads."""
    hidden, hidden_biases, output, output_biases, linear = parameters

    def learned(inputs):
        steps = torch.relu(torch.tensor(inputs) @ hidden.T + hidden_biases)
        return torch.tanh(steps @ output.T + output_biases).sum(dim=1)

    differences = learned(lesson.pairs.inputs_a) - learned(lesson.pairs.inputs_b)
    features = torch.cat([torch.tensor(lesson.pairs.hand_coded_diffs), differences], dim=1)
    logits = torch.tensor(lesson.pairs.base_logits) + features @ linear
    of_a = lesson.lapse_rate / 2 + (1 - lesson.lapse_rate) * torch.sigmoid(logits)
    z = torch.tensor((lesson.signs + 1) / 2)
    return -(z * torch.log(of_a) + (1 - z) * torch.log(1 - of_a)).mean()
