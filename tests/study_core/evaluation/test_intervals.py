import numpy as np
import pytest

from study_core.evaluation.intervals import mean_over_people


def test_one_person_leaves_no_room():
    found = mean_over_people(0, [0.7])
    assert (found.value, found.low, found.high) == (0.7, 0.7, 0.7)


def test_a_constant_gain_has_an_interval_of_its_own_width():
    values = np.random.default_rng(1).random(12)
    low, high = (mean_over_people(3, (values + gain).tolist()) for gain in (0.0, 0.25))
    assert high.low - low.low == pytest.approx(0.25)
    assert high.high - low.high == pytest.approx(0.25)


@pytest.mark.statistical
def test_nineteen_of_twenty_intervals_hold_the_truth():
    rng = np.random.default_rng(4)
    found = [mean_over_people(seed, rng.normal(0.7, 0.1, 30).tolist()) for seed in range(300)]
    share = np.mean([one.low <= 0.7 <= one.high for one in found])
    assert 0.89 < share < 0.98
