"""The chains against brute force, and planted errors, each of which the same comparison finds."""

from dataclasses import replace

import numpy as np
import pytest

from study_core import choice_kernels
from study_core.choice import PARAMETER_PRIORS, ParameterPrior, ResponseModel
from study_core.posterior import target as target_module
from study_core.posterior.annealing import learn_proposal
from study_core.posterior.metropolis import run_chains
from study_core.posterior.prior import Prior
from study_core.posterior.target import Target
from tests.study_core.posterior import brute_force
from tests.study_core.posterior.brute_force import Case

# Fifty numbers are compared in each of two dozen cases: 4.5 standard errors happen by chance once in 100 such suites.
LARGEST_Z = 4.5

CASES = {
    "sigmoid on the ball": Case("ball"),
    "sigmoid on the sphere": Case("sphere"),
    "lapses on the ball": Case("ball", rationality=60.0, lapse_rate=0.1),
    "lapses on the sphere": Case("sphere", rationality=60.0, lapse_rate=0.1),
    "clipped on the ball": Case("ball", model="clipped-linear", rationality=3.0),
    "clipped on the sphere": Case("sphere", model="clipped-linear", rationality=3.0),
    "ties with lapses": Case("sphere", lapse_rate=0.1, tie_threshold=1.0),
    "ties without lapses": Case("ball", tie_threshold=0.4),
    "rationality inferred": Case("sphere", rationality=None),
    "rationality and lapses inferred": Case("sphere", rationality=None, lapse_rate=None),
    "rationality and lapses inferred on the ball": Case("ball", rationality=None, lapse_rate=None),
    "everything inferred": Case("sphere", rationality=None, lapse_rate=None, tie_threshold=None),
    "two features": Case("sphere", 2, lapse_rate=0.1),
    "two features on the ball": Case("ball", 2, rationality=None),
    "seven features": Case("sphere", 7, lapse_rate=None),
}


def response_of(case):
    settings = (case.rationality, case.lapse_rate, case.tie_threshold)
    return ResponseModel(case.model, *("inferred" if value is None else value for value in settings))


def estimate_of_product(case, comparisons, seed=5, n_draws=4000):
    """What the product's chains say of a case."""
    rng = np.random.default_rng(seed)
    target = Target(Prior(case.support, case.d), response_of(case), comparisons)
    points = run_chains(rng, target, learn_proposal(rng, target, 200, 4), n_draws).points
    flat = points.reshape(-1, target.n_coordinates)
    rows = target.parameters(flat)
    parameters = (rows.rationality, rows.lapse_rate, rows.tie_threshold)
    return brute_force.estimate_of_chains(target.weights(flat).reshape(4, n_draws, case.d), parameters)


@pytest.mark.statistical
@pytest.mark.parametrize(("name", "n_answers"), [(name, n) for name in CASES for n in (0, 5, 25)])
def test_the_posterior_is_what_brute_force_gives(name, n_answers):
    case = CASES[name]
    comparisons = brute_force.answers(case, n_answers)
    found = estimate_of_product(case, comparisons)
    assert brute_force.largest_z(found, brute_force.estimate(case, comparisons)) < LARGEST_Z


@pytest.mark.statistical
def test_different_seeds_agree():
    case = CASES["lapses on the sphere"]
    comparisons = brute_force.answers(case, 40)
    first, second = (estimate_of_product(case, comparisons, seed) for seed in (1, 2))
    assert 0.0 < brute_force.largest_z(first, second) < LARGEST_Z


def with_flipped_signs(monkeypatch):
    monkeypatch.setattr(
        target_module, "pack", lambda diffs, signs: choice_kernels.pack(diffs, -np.ascontiguousarray(signs))
    )


def with_another_prior_of_beta(monkeypatch):
    monkeypatch.setitem(PARAMETER_PRIORS, "rationality", ParameterPrior("log", float(np.log(50.0)), 0.5))


PLANTED = {
    "sign flipped": with_flipped_signs,
    "wrong prior of the rationality": with_another_prior_of_beta,
}


@pytest.mark.statistical
@pytest.mark.parametrize("error", PLANTED)
def test_a_planted_error_is_caught_by_brute_force(monkeypatch, error):
    case = CASES["rationality and lapses inferred"]
    comparisons = brute_force.answers(case, 25)
    expected = brute_force.estimate(case, comparisons)
    assert brute_force.largest_z(estimate_of_product(case, comparisons), expected) < LARGEST_Z
    PLANTED[error](monkeypatch)
    assert brute_force.largest_z(estimate_of_product(case, comparisons), expected) > 2 * LARGEST_Z


@pytest.mark.statistical
def test_a_missing_lapse_is_caught_by_brute_force():
    case = CASES["lapses on the sphere"]
    comparisons = brute_force.answers(case, 60)
    expected = brute_force.estimate(case, comparisons)
    forgotten = estimate_of_product(replace(case, lapse_rate=0.0), comparisons)
    assert brute_force.largest_z(forgotten, expected) > 2 * LARGEST_Z


@pytest.mark.statistical
@pytest.mark.parametrize("n_answers", [0, 5])
def test_a_wrong_prior_of_the_weights_is_caught_by_brute_force(n_answers):
    """The ball in place of the sphere."""
    case = CASES["sigmoid on the sphere"]
    comparisons = brute_force.answers(case, n_answers)
    expected = brute_force.estimate(case, comparisons)
    on_the_ball = estimate_of_product(replace(case, support="ball"), comparisons)
    assert brute_force.largest_z(on_the_ball, expected) > 2 * LARGEST_Z
