"""Controls come back from the states of a loop over steps, and nothing else does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from study_core.domains.driving.recover import recover_controls
from study_core.errors import NotATrajectoryError
from tests.study_core import references


def driven(controls):
    return np.array([references.drive(references.ROBOT_START, row) for row in controls])


def random_controls(n=30):
    return np.random.default_rng(5).uniform(-1.0, 1.0, (n, 10))


def test_controls_come_back():
    controls = random_controls()
    np.testing.assert_allclose(recover_controls(driven(controls)), controls, rtol=0, atol=1e-9)


@pytest.mark.parametrize("bound", [-1.0, 1.0])
def test_controls_at_their_bounds_come_back_within_them(bound):
    controls = np.where(random_controls() > 0.0, bound, random_controls())
    recovered = recover_controls(driven(controls))
    np.testing.assert_allclose(recovered, controls, rtol=0, atol=1e-9)
    assert np.abs(recovered).max() <= 1.0


@given(controls=arrays(np.float64, (2, 10), elements=st.floats(-1.0, 1.0)))
def test_recovered_controls_drive_the_same_way_whatever_was_steered(controls):
    recovered = recover_controls(driven(controls))
    np.testing.assert_allclose(driven(recovered), driven(controls), rtol=0, atol=1e-9)


def test_a_car_that_stops_and_stays_is_recovered_but_for_its_steering():
    controls = random_controls(1)
    # Gas of the first block that ends it at a standstill; after it, none.
    controls[0, 1] = -0.4 * 0.9**10 / (1.0 - 0.9**10)
    controls[0, 3::2] = 0.0
    recovered = recover_controls(driven(controls))
    np.testing.assert_allclose(recovered[0, :2], controls[0, :2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(recovered[0, 3::2], 0.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(driven(recovered), driven(controls), rtol=0, atol=1e-9)


def test_no_drives_have_no_controls():
    assert recover_controls(np.empty((0, 50, 4))).shape == (0, 10)


@pytest.mark.parametrize("state", range(4), ids=["x", "y", "heading", "speed"])
@pytest.mark.parametrize("step", [0, 23, 49])
def test_a_path_that_leaves_the_dynamics_is_refused_and_named(state, step):
    states = driven(random_controls(4))
    states[2, step, state] += 1e-7
    with pytest.raises(NotATrajectoryError, match="drive 2 of 4"):
        recover_controls(states)


@pytest.mark.parametrize("control", [0, 3])
def test_controls_beyond_their_bounds_are_refused(control):
    controls = random_controls(1)
    controls[0, control] = 1.001
    with pytest.raises(NotATrajectoryError):
        recover_controls(driven(controls))


def test_numbers_that_are_not_finite_are_refused():
    states = driven(random_controls(2))
    states[1, 7, 0] = np.nan
    with pytest.raises(NotATrajectoryError, match="drive 1 of 2"):
        recover_controls(states)
