"""The evidence against brute force, its stated error, and what it chooses."""

import math

import numpy as np
import pytest

from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior.evidence import GRID, choose_by_evidence, log_evidence
from study_core.posterior.prior import Prior
from tests.study_core.posterior import brute_force
from tests.study_core.posterior.brute_force import Case

CASES = {
    "ball": Case("ball"),
    "sphere with lapses": Case("sphere", rationality=60.0, lapse_rate=0.1),
    "everything inferred": Case("sphere", rationality=None, lapse_rate=None, tie_threshold=None),
    "two features": Case("ball", 2, rationality=None),
    "seven features": Case("sphere", 7, lapse_rate=0.1),
}


def estimate(case, comparisons, seed):
    settings = (case.rationality, case.lapse_rate, case.tie_threshold)
    model = ResponseModel(case.model, *("inferred" if value is None else value for value in settings))
    return log_evidence(np.random.default_rng(seed), Prior(case.support, case.d), model, comparisons)


@pytest.mark.statistical
@pytest.mark.parametrize(("name", "n_answers"), [(name, n) for name in CASES for n in (0, 3, 30)])
def test_the_evidence_is_what_brute_force_gives(name, n_answers):
    case = CASES[name]
    comparisons = brute_force.answers(case, n_answers)
    expected, brute_error = brute_force.log_evidence(case, comparisons)
    found = estimate(case, comparisons, seed=1)
    assert found.standard_error < 0.1
    error = math.hypot(found.standard_error, brute_error)
    assert abs(found.log_evidence - expected) < 4.5 * error
    if n_answers == 0:
        assert expected == 0.0


@pytest.mark.statistical
def test_the_stated_error_is_the_spread_over_seeds():
    case = CASES["sphere with lapses"]
    comparisons = brute_force.answers(case, 30)
    found = [estimate(case, comparisons, seed) for seed in range(60)]
    spread = np.std([each.log_evidence for each in found], ddof=1)
    stated = np.mean([each.standard_error for each in found])
    assert 0.7 < spread / stated < 1.4


def test_nothing_to_choose_comes_back_as_it_is_and_draws_nothing():
    rng = np.random.default_rng(1)
    model = ResponseModel("sigmoid", "inferred", 0.1)
    assert choose_by_evidence(rng, Prior("sphere", 4), model, ComparisonSet.empty(4)) is model
    assert rng.random() == np.random.default_rng(1).random()


@pytest.mark.statistical
@pytest.mark.parametrize(("rationality", "lapse_rate"), [(50.0, 0.01), (200.0, 0.2)])
def test_many_answers_choose_what_they_were_given_with(rationality, lapse_rate):
    case = Case("sphere", rationality=rationality, lapse_rate=lapse_rate)
    comparisons = brute_force.answers(case, 400)
    model = ResponseModel("sigmoid", "evidence", "evidence")
    chosen = choose_by_evidence(np.random.default_rng(2), Prior("sphere", 4), model, comparisons)
    steps = [
        abs(GRID[name].index(value) - GRID[name].index(truth))
        for name, value, truth in (
            ("rationality", chosen.rationality, rationality),
            ("lapse_rate", chosen.lapse_rate, lapse_rate),
        )
    ]
    assert max(steps) <= 1, chosen


def test_without_answers_the_priors_mode_is_chosen():
    model = ResponseModel("sigmoid", "evidence", "evidence")
    chosen = choose_by_evidence(np.random.default_rng(3), Prior("sphere", 4), model, ComparisonSet.empty(4))
    assert chosen == ResponseModel("sigmoid", 50.0, 0.05)


def test_what_is_inferred_is_integrated_out_while_the_rest_is_chosen():
    model = ResponseModel("sigmoid", "evidence", "inferred")
    comparisons = brute_force.answers(CASES["sphere with lapses"], 20)
    chosen = choose_by_evidence(np.random.default_rng(4), Prior("sphere", 4), model, comparisons)
    assert chosen.rationality in GRID["rationality"]
    assert chosen.lapse_rate == "inferred"
