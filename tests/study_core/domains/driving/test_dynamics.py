"""The closed form against a loop over steps, straight from the equations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from study_core.domains.driving import DRIVING_V1
from study_core.domains.driving.dynamics import HUMAN_PATH, simulate
from tests.study_core import references

CONTROLS = arrays(np.float64, (2, 10), elements=st.floats(-1.0, 1.0))

# Points of the human car's path in the data of the paper's figure of optimised trajectories, by step.
PAPERS_HUMAN_CAR = {
    1: (0.17, 0.041),
    12: (0.16831947092058408, 0.4919655443270712),
    15: (0.15323704458682028, 0.6139678925568459),
    21: (0.07896094190961467, 0.8478544647643296),
    50: (0.0042648662665907095, 2.1650609043078184),
}


def random_controls(seed, n):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 10))


def test_a_rollout_is_what_a_loop_over_steps_gives():
    controls = random_controls(1, 40)
    expected = [references.drive(references.ROBOT_START, row) for row in controls]
    np.testing.assert_allclose(DRIVING_V1.rollout(controls), expected, rtol=0, atol=1e-12)


@given(controls=CONTROLS)
def test_a_rollout_is_what_a_loop_over_steps_gives_for_any_legal_controls(controls):
    expected = [references.drive(references.ROBOT_START, row) for row in controls]
    np.testing.assert_allclose(DRIVING_V1.rollout(controls), expected, rtol=0, atol=1e-12)


def test_one_step_uses_only_the_old_state():
    start = np.array([0.3, -0.2, 1.0, 0.5])
    controls = np.full((1, 10), 0.7)
    x, y, heading, speed = simulate(start, controls)[0, 1]
    expected = [0.3 + 0.05 * math.cos(1.0), -0.2 + 0.05 * math.sin(1.0), 1.0 + 0.05 * 0.7, 0.5 + 0.1 * 0.2]
    np.testing.assert_allclose([x, y, heading, speed], expected, rtol=0, atol=1e-15)


def test_a_simulation_includes_its_start_and_a_rollout_leaves_it_out():
    controls = random_controls(2, 1)
    path = simulate(np.array(references.ROBOT_START), controls)
    assert path.shape == (1, 51, 4)
    np.testing.assert_array_equal(path[0, 0], references.ROBOT_START)
    np.testing.assert_array_equal(DRIVING_V1.rollout(controls), path[:, 1:])


def test_the_human_car_drives_as_the_loop_says():
    np.testing.assert_allclose(HUMAN_PATH[1:], references.HUMAN_STATES, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(HUMAN_PATH[0], references.HUMAN_START)


@pytest.mark.parametrize("step", PAPERS_HUMAN_CAR)
def test_the_human_car_drives_as_in_the_papers_figure(step):
    np.testing.assert_allclose(HUMAN_PATH[step, :2], PAPERS_HUMAN_CAR[step], rtol=0, atol=1e-12)


def test_steering_left_goes_left_and_full_gas_nears_speed_one():
    left = np.tile([0.3, 1.0], 5)[None]
    states = DRIVING_V1.rollout(left)[0]
    assert states[-1, 0] < -0.1
    assert states[-1, 2] > math.pi / 2
    # Speed approaches the gas with a time constant of 1 s: after 5 s, (1 - 0.1)^50 of the difference is left.
    assert states[-1, 3] == pytest.approx(1.0 - 0.6 * 0.9**50, abs=1e-12)
