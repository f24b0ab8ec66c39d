"""Every registered acquisition method keeps the contract."""

import numpy as np
import pytest

from study_core.acquisition import METHODS, acquisition_named
from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import ComparisonSet
from study_core.errors import UnknownNameError
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.prior import Prior
from study_core.posterior.run import Posterior, SamplerSettings, infer

NONE = Diagnostics(np.ones(4), np.ones(4), np.ones(4), 0.3, 4000)


def made_up(log_likelihoods, samples=None):
    if samples is None:
        samples = Prior("sphere", 4).draw(np.random.default_rng(1), len(log_likelihoods))
    parameters = ResponseParameters.constant(len(samples), 50.0)
    return Posterior(samples, parameters, np.array(log_likelihoods), samples.mean(axis=0), NONE)


def inferred(n_answers):
    rng = np.random.default_rng(n_answers)
    answers = ComparisonSet(rng.normal(0, 0.1, (n_answers, 4)), rng.choice([-1.0, 1.0], n_answers))
    response, settings = ResponseModel("sigmoid", 200.0, 0.1), SamplerSettings(4, 200, 300, 300, 40)
    return infer(rng, Prior("sphere", 4), response, answers, settings)


POSTERIORS = {
    "no answers": lambda: inferred(0),
    "one answer": lambda: inferred(1),
    "a hundred answers": lambda: inferred(100),
    "likelihoods that underflow": lambda: made_up([-1e6, -2e6, -1e9, -5e5, -7e5, -1e6]),
    "all samples alike": lambda: made_up(np.full(30, -3.0), np.full((30, 4), 0.5)),
    "two samples": lambda: made_up([-1.0, -2.0]),
}


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("posterior", [pytest.param(make, id=key) for key, make in POSTERIORS.items()])
@pytest.mark.parametrize("n_pairs", [1, 11, 10**6])
def test_a_method_keeps_the_contract(name, posterior, n_pairs):
    given = posterior()
    samples, log_likelihoods = given.samples.copy(), given.log_likelihoods.copy()
    ranked = acquisition_named(name)(np.random.default_rng(3), given, 0.1, n_pairs)
    n = len(samples)
    pairs = [tuple(pair) for pair in ranked.indices.tolist()]
    assert ranked.indices.shape == (min(n_pairs, n * (n - 1) // 2), 2)
    assert ranked.scores.shape == (len(pairs),)
    assert all(0 <= i < j < n for i, j in pairs)
    assert len(set(pairs)) == len(pairs)
    assert np.isfinite(ranked.scores).all()
    assert (np.diff(ranked.scores) <= 0).all()
    again = acquisition_named(name)(np.random.default_rng(3), given, 0.1, n_pairs)
    np.testing.assert_array_equal(again.indices, ranked.indices)
    np.testing.assert_array_equal(again.scores, ranked.scores)
    np.testing.assert_array_equal(given.samples, samples)
    np.testing.assert_array_equal(given.log_likelihoods, log_likelihoods)


def test_a_method_is_found_by_the_name_that_a_study_uses():
    assert set(METHODS) >= {"heuristic", "random"}
    assert all(acquisition_named(name) is method for name, method in METHODS.items())


def test_a_misspelt_method_is_answered_with_the_closest_name():
    with pytest.raises(UnknownNameError) as raised:
        acquisition_named("heuristik")
    assert str(raised.value) == "No acquisition method named 'heuristik'. Did you mean 'heuristic'?"
