import math

import numpy as np
import pytest

from study_core.errors import TooFewAnswersError
from study_core.evaluation.scores import calibration, score


def test_scores_by_hand():
    found = score(np.array([0.9, 0.2, 0.6, 0.5]), np.array([1.0, -1.0, -1.0, 1.0]))
    assert found.accuracy == (1 + 1 + 0 + 0.5) / 4
    assert found.log_loss == pytest.approx(-math.log(0.9 * 0.8 * 0.4 * 0.5) / 4)
    assert found.expected_accuracy == pytest.approx((0.9 + 0.8 + 0.6 + 0.5) / 4)


def test_swapping_a_and_b_changes_nothing():
    rng = np.random.default_rng(1)
    probabilities, signs = rng.random(50), rng.choice([-1.0, 1.0], 50)
    one, other = score(probabilities, signs), score(1.0 - probabilities, -signs)
    assert one.accuracy == other.accuracy
    assert one.log_loss == pytest.approx(other.log_loss)


def test_a_certain_prediction_that_fails_costs_much_but_not_everything():
    assert 20.0 < score(np.array([1.0]), np.array([-1.0])).log_loss < 40.0


@pytest.mark.parametrize("wrong", [np.nan, -0.1, 1.1])
def test_what_is_no_probability_is_refused(wrong):
    with pytest.raises(ValueError, match="probabilities from 0 to 1"):
        score(np.array([0.5, wrong]), np.ones(2))


def test_nothing_to_score_is_refused():
    with pytest.raises(TooFewAnswersError, match="at least one answer"):
        score(np.empty(0), np.empty(0))


@pytest.mark.statistical
def test_honest_predictions_lie_on_the_diagonal_and_boastful_ones_below():
    rng = np.random.default_rng(2)
    honest = rng.random(40_000)
    signs = np.where(rng.random(len(honest)) < honest, 1.0, -1.0)
    for one in calibration(honest, signs, 10):
        # Four standard errors of a share of 4,000.
        assert abs(one.accuracy - one.confidence) < 4 * math.sqrt(0.25 / one.n)
    boastful = 1.0 / (1.0 + ((1.0 - honest) / honest) ** 3)
    middle = calibration(boastful, signs, 10)[5]
    assert middle.accuracy < middle.confidence - 0.1


def test_bins_hold_every_prediction_once():
    rng = np.random.default_rng(3)
    bins = calibration(rng.random(103), np.ones(103), 10)
    assert sum(one.n for one in bins) == 103
    assert [one.confidence for one in bins] == sorted(one.confidence for one in bins)
    assert len(calibration(rng.random(3), np.ones(3), 10)) == 3
