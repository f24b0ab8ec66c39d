"""Every registered acquisition method keeps the contract."""

from dataclasses import fields

import numpy as np
import pytest
import torch

from study_core.acquisition import METHODS, acquisition_named
from study_core.acquisition.pairs import RankedTrajectories, Situation
from study_core.bank import build_bank
from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import ComparisonSet
from study_core.domains.driving import DRIVING_V1
from study_core.errors import UnknownNameError
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.prior import Prior
from study_core.posterior.run import Posterior, SamplerSettings, infer
from tests.study_core import references

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


@pytest.fixture(scope="module")
def bank():
    return build_bank(DRIVING_V1, 60)


def situation_of(posterior, bank):
    return Situation(DRIVING_V1, posterior, bank, mu=0.1, min_difference=0.5)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("posterior", [pytest.param(make, id=key) for key, make in POSTERIORS.items()])
def test_a_method_ranks_different_pairs_best_first(name, posterior, bank):
    ranked = METHODS[name].rank_pairs(np.random.default_rng(3), situation_of(posterior(), bank), 11)
    pairs = ranked.controls if isinstance(ranked, RankedTrajectories) else ranked.weights
    n_controls_or_features = 10 if isinstance(ranked, RankedTrajectories) else 4
    assert 1 <= len(ranked) <= 11
    assert pairs.shape == (len(ranked), 2, n_controls_or_features)
    assert ranked.scores.shape == (len(ranked),)
    assert np.isfinite(ranked.scores).all()
    assert (np.diff(ranked.scores) <= 0).all()
    if posterior is not POSTERIORS["all samples alike"]:
        assert len({pair.tobytes() for pair in pairs}) == len(ranked)


@pytest.mark.parametrize("name", METHODS)
def test_one_pair_is_the_first_of_many(name, bank):
    situation = situation_of(inferred(3), bank)
    one, many = (METHODS[name].rank_pairs(np.random.default_rng(3), situation, n) for n in (1, 11))
    assert len(one) == 1
    assert name in ("random", "thompson") or one.scores[0] == many.scores[0]


@pytest.mark.parametrize("name", METHODS)
def test_a_method_is_repeatable_and_leaves_what_it_is_given_alone(name, bank):
    situation = situation_of(inferred(3), bank)
    before = situation.posterior.samples.copy(), situation.posterior.log_densities.copy()
    first, second = (METHODS[name].rank_pairs(np.random.default_rng(3), situation, 11) for _ in range(2))
    for field in fields(first):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))
    np.testing.assert_array_equal(situation.posterior.samples, before[0])
    np.testing.assert_array_equal(situation.posterior.log_densities, before[1])


@pytest.mark.parametrize("name", METHODS)
def test_trajectories_are_within_bounds_and_locally_the_best_for_their_weights(name, bank):
    ranked = METHODS[name].rank_pairs(np.random.default_rng(3), situation_of(inferred(3), bank), 5)
    if not isinstance(ranked, RankedTrajectories):
        return
    controls = ranked.controls.reshape(-1, 10)
    assert (np.abs(controls) <= 1.0).all()
    if ranked.weights is not None:
        for own, weights in zip(controls, ranked.weights.reshape(-1, 4), strict=True):
            drive = torch.tensor(own, dtype=torch.float64, requires_grad=True)
            references.torch_reward(drive, torch.tensor(weights)).backward()
            assert np.abs(np.clip(own + drive.grad.numpy(), -1.0, 1.0) - own).max() < 1e-5


def test_only_methods_that_choose_among_its_drives_need_a_bank():
    assert {name for name, method in METHODS.items() if method.needs_bank} == {
        "information-gain-realistic",
        "random",
        "regret",
    }
    assert len({method.version for method in METHODS.values()}) == len(METHODS)


def test_a_method_is_found_by_the_name_that_a_study_uses():
    assert set(METHODS) >= {"heuristic", "information-gain-realistic", "random"}
    assert all(acquisition_named(name) is method for name, method in METHODS.items())


def test_a_misspelt_method_is_answered_with_the_closest_name():
    with pytest.raises(UnknownNameError) as raised:
        acquisition_named("heuristik")
    assert str(raised.value) == "No acquisition method named 'heuristik'. Did you mean 'heuristic'?"
