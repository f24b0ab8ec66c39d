"""The shared network: what it sees, that it learns what no given feature says, and its head for somebody new."""

import numpy as np
import pytest
import torch

from study_core.predictors import shared_network
from study_core.predictors.predictor import Pairs, Training
from study_core.predictors.shared_network import NetworkFeatures, SharedNetwork
from tests.study_core.hills import HillsDomain


class WalkDomain(HillsDomain):
    """Twenty steps to a point of the map; nothing that is given tells how far it is from the middle."""

    id = "walk-v1"
    N_STEPS = 20

    def rollout(self, controls):
        return np.linspace(0.05, 1.0, self.N_STEPS)[:, None] * controls[:, None, :]


DOMAIN = WalkDomain()


def pairs_of(seed, n):
    states = DOMAIN.rollout(np.random.default_rng(seed).uniform(-1.0, 1.0, (2 * n, 2)))
    return Pairs(states[:n], states[n:])


def stays_away(pairs):
    """Prefers what ends farther from the middle: a ring, which no linear function of the inputs tells."""
    radius_a, radius_b = (np.hypot(*states[:, -1].T) for states in (pairs.states_a, pairs.states_b))
    return np.where(radius_a > radius_b, 1.0, -1.0)


def training_of(seed, n, turned=1.0):
    pairs = pairs_of(seed, n)
    return Training(pairs, turned * stays_away(pairs))


PEOPLE = {name: training_of(seed, 60) for seed, name in enumerate(("ada", "ben", "cleo", "dora"))}
NEW_PAIRS = pairs_of(99, 200)


@pytest.fixture(scope="module")
def fitted():
    return SharedNetwork().fit(5, DOMAIN, PEOPLE)


def test_it_learns_a_feature_that_nobody_wrote_down(fitted):
    for person in fitted.people.values():
        found = person.probability_of_a(NEW_PAIRS) > 0.5
        assert np.mean(found == (stays_away(NEW_PAIRS) > 0)) > 0.85


def test_somebody_new_without_answers_is_like_the_others(fitted):
    found = fitted.with_person(0, training_of(50, 0)).probability_of_a(NEW_PAIRS) > 0.5
    assert np.mean(found == (stays_away(NEW_PAIRS) > 0)) > 0.85


def test_somebody_new_of_the_opposite_taste_gets_a_head_of_their_own(fitted):
    contrary = fitted.with_person(0, training_of(51, 60, turned=-1.0)).probability_of_a(NEW_PAIRS) > 0.5
    assert np.mean(contrary == (stays_away(NEW_PAIRS) < 0)) > 0.7


def test_another_seed_begins_elsewhere(fitted):
    other = SharedNetwork().fit(6, DOMAIN, PEOPLE)
    one, another = (model.people["ada"].probability_of_a(NEW_PAIRS) for model in (fitted, other))
    assert not np.array_equal(one, another)


def test_inputs_are_states_network_inputs_and_time():
    """Every second of twenty steps, from the second on."""
    states = pairs_of(1, 3).states_a
    inputs = shared_network._inputs(DOMAIN, states)
    shown = np.arange(1, 20, 2)
    assert inputs.shape == (3, 10, 2 + 1 + 1)
    np.testing.assert_array_equal(inputs[..., :2], states[:, shown])
    np.testing.assert_array_equal(inputs[..., 2], states[:, shown, 0])
    np.testing.assert_allclose(inputs[..., 3], np.tile(-1 + 2 * shown / 19, (3, 1)))


@pytest.mark.parametrize("n_steps", [1, 3, 10, 11, 50])
def test_any_number_of_steps_is_shown_by_at_most_ten(n_steps):
    states = np.random.default_rng(0).normal(size=(2, n_steps, 2))
    n_shown = shared_network._inputs(DOMAIN, states).shape[1]
    assert 1 <= n_shown <= 10
    assert n_shown == n_steps or n_steps > 10


def test_features_are_a_mean_over_steps_of_three_layers(fitted):
    """Written as loops over trajectories and steps."""
    network = fitted.embedding.features
    assert isinstance(network, NetworkFeatures)
    states = pairs_of(2, 4).states_a
    expected = []
    for inputs in shared_network._inputs(DOMAIN, states):
        outputs = []
        for step in inputs:
            values = [
                (x - m) * s for x, m, s in zip(step, network.means, network.inverse_scales, strict=True)
            ]
            for matrix, bias in network.layers:
                values = np.tanh(
                    [b + np.dot(values, column) for column, b in zip(matrix.T, bias, strict=True)]
                )
            outputs.append(values)
        expected.append(np.mean(outputs, axis=0))
    np.testing.assert_allclose(network(states), expected, atol=1e-12)


def test_the_gradient_of_the_loss_is_a_finite_difference():
    rng = np.random.default_rng(4)
    parameters = shared_network._first_parameters(rng, 3, 2)
    seen = torch.tensor(rng.normal(size=(12, 5, 3)), dtype=torch.float32)
    signs, who = torch.tensor([1.0, -1, 1, 1, -1, -1]), torch.tensor([0, 0, 0, 1, 1, 1])
    loss = shared_network._loss(parameters, seen, signs, who)
    loss.backward()
    for tensor in parameters:
        place = tuple(0 for _ in tensor.shape)
        slope = float(tensor.grad[place])
        with torch.no_grad():
            values = []
            for step in (1e-2, -2e-2):
                tensor[place] += step
                values.append(float(shared_network._loss(parameters, seen, signs, who)))
            tensor[place] += 1e-2
        assert (values[0] - values[1]) / 2e-2 == pytest.approx(slope, abs=2e-2)


def test_training_leaves_one_thread(fitted):
    assert torch.get_num_threads() == 1


def test_one_step_is_a_trajectory_too():
    """Time is constant then, and drops out."""
    hills = HillsDomain()
    states = hills.rollout(np.random.default_rng(1).uniform(-1.0, 1.0, (40, 2)))
    pairs = Pairs(states[:20], states[20:])
    signs = np.where(pairs.states_a[:, 0, 0] > pairs.states_b[:, 0, 0], 1.0, -1.0)
    fitted = SharedNetwork().fit(0, hills, {"ada": Training(pairs, signs)})
    assert np.isfinite(fitted.people["ada"].probability_of_a(pairs)).all()
