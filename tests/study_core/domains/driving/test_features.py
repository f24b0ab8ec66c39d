"""Features, network inputs and the reward's gradient against a naive loop and automatic differentiation."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from study_core.domains.driving import DRIVING_V1
from tests.study_core import references


def random_controls(seed, n):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 10))


def test_features_are_what_a_loop_over_states_gives():
    controls = random_controls(3, 40)
    expected = [references.features(references.drive(references.ROBOT_START, row)) for row in controls]
    np.testing.assert_allclose(
        DRIVING_V1.features(DRIVING_V1.rollout(controls)), expected, rtol=0, atol=1e-12
    )


@given(states=arrays(np.float64, (1, 50, 4), elements=st.floats(-5.0, 5.0)))
def test_features_are_what_a_loop_gives_for_states_that_no_drive_reaches(states):
    np.testing.assert_allclose(
        DRIVING_V1.features(states)[0], references.features(states[0]), rtol=1e-12, atol=1e-12
    )


def test_features_stay_in_the_ranges_of_the_data_sheet():
    features = DRIVING_V1.features(DRIVING_V1.rollout(random_controls(4, 2000)))
    lower, upper = [0.0, -4.0, -1.0, -1.0], [1.0, 0.0, 1.0, 0.0]
    assert (features >= lower).all()
    assert (features <= upper).all()
    assert (features[:, 0] > 0).all()
    assert (features[:, 3] < 0).all()


def time_gap(y, v, human):
    """The paper's quotient, damped by a tenth of the unit of speed and kept within the drive's five seconds."""
    dy, dv = y - human[1], v - human[3]
    return max(-5.0, min(5.0, dy * dv / (dv * dv + 0.01)))


def test_network_inputs_are_x_distance_heading_speed_and_time_gap():
    states = DRIVING_V1.rollout(random_controls(5, 3))
    expected = [
        [
            [x, math.dist((x, y), human[:2]), theta, v, time_gap(y, v, human)]
            for (x, y, theta, v), human in zip(path, references.HUMAN_STATES, strict=True)
        ]
        for path in states
    ]
    np.testing.assert_allclose(DRIVING_V1.network_inputs(states), expected, rtol=0, atol=1e-12)
    assert DRIVING_V1.network_input_names == ("x", "distance", "heading", "speed", "time_gap")


def with_human(dy, dv):
    """A path beside the human car: so far ahead of it, so much faster."""
    states = np.array(references.HUMAN_STATES)[None]
    return states + np.array([0.0, dy, 0.0, dv])


@pytest.mark.parametrize("dy", [0.0, 0.3, -2.0, 1e-9])
def test_at_equal_speeds_the_time_gap_is_zero_and_not_infinite(dy):
    gaps = DRIVING_V1.network_inputs(with_human(dy, 0.0))[0, :, 4]
    np.testing.assert_allclose(gaps, 0.0, rtol=0, atol=1e-12)


def test_a_time_gap_is_almost_the_papers_where_that_is_a_matter_of_the_drive():
    gaps = DRIVING_V1.network_inputs(with_human(0.9, 0.6))[0, :, 4]
    np.testing.assert_allclose(gaps, 0.9 / 0.6, rtol=0.03)
    assert (DRIVING_V1.network_inputs(with_human(-0.9, 0.6))[0, :, 4] < 0.0).all()


@given(dy=st.floats(-50.0, 50.0), dv=st.floats(-5.0, 5.0))
def test_no_time_gap_is_longer_than_the_drive(dy, dv):
    assert (np.abs(DRIVING_V1.network_inputs(with_human(dy, dv))[0, :, 4]) <= 5.0).all()


# Each feature alone, so that a small term can't hide behind a large one, and mixtures of either sign.
WEIGHTS = [*np.eye(4), [0.36, 0.2, 0.39, 0.25], [-0.4, 0.7, 0.1, -0.9]]


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_reward_and_gradient_are_what_automatic_differentiation_of_a_loop_gives(weights):
    controls = random_controls(6, 12)
    rewards, gradients = DRIVING_V1.reward_and_gradient(controls, np.tile(np.array(weights), (12, 1)))
    for row, reward, gradient in zip(controls, rewards, gradients, strict=True):
        tensor = torch.tensor(row, requires_grad=True)
        expected = references.torch_reward(tensor, [float(w) for w in weights])
        expected.backward()
        assert reward == pytest.approx(expected.item(), abs=1e-12)
        np.testing.assert_allclose(gradient, tensor.grad.numpy(), rtol=0, atol=1e-12)


def test_every_row_has_its_own_weights():
    controls = np.repeat(random_controls(7, 1), 4, axis=0)
    rewards, gradients = DRIVING_V1.reward_and_gradient(controls, np.eye(4))
    expected = references.features(references.drive(references.ROBOT_START, controls[0]))
    np.testing.assert_allclose(rewards, expected, rtol=0, atol=1e-12)
    assert len(np.unique(gradients.round(12), axis=0)) == 4


@given(controls=arrays(np.float64, (1, 10), elements=st.floats(-1.0, 1.0)))
def test_the_compiled_reward_is_the_features_times_the_weights(controls):
    weights = np.array([[0.5, 0.4, 0.3, 0.7]])
    rewards, _ = DRIVING_V1.reward_and_gradient(controls, weights)
    expected = DRIVING_V1.features(DRIVING_V1.rollout(controls)) @ weights[0]
    np.testing.assert_allclose(rewards, expected, rtol=0, atol=1e-12)


def test_controls_and_weights_need_not_be_contiguous():
    wide, heavy = random_controls(8, 10).repeat(2, axis=1), np.random.default_rng(9).random((20, 4))
    strided = DRIVING_V1.reward_and_gradient(wide[:, ::2], heavy[::2])
    packed = DRIVING_V1.reward_and_gradient(wide[:, ::2].copy(), heavy[::2].copy())
    np.testing.assert_array_equal(strided[0], packed[0])
    np.testing.assert_array_equal(strided[1], packed[1])
