"""The posterior keeps an even share of its draws, diagnoses all of them, and draws until they are enough."""

import arviz
import numpy as np
import pytest
from scipy import stats

from study_core.choice import PARAMETER_PRIORS, ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior import run
from study_core.posterior.annealing import learn_proposal
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.metropolis import run_chains
from study_core.posterior.prior import Prior
from study_core.posterior.run import SamplerSettings, infer
from study_core.posterior.target import Target
from study_core.streams import stream
from study_core.study_file import SamplerSection
from tests.study_core import references
from tests.study_core.posterior import brute_force
from tests.study_core.posterior.brute_force import Case

MODEL, PRIOR = ResponseModel("sigmoid", 50.0, 0.1), Prior("sphere", 4)
INFERRED = ResponseModel("sigmoid", "inferred", "inferred", "inferred")
ONE_ROUND = SamplerSettings(n_chains=4, n_warmup=200, n_draws=500, most_draws=500, n_samples=100)
DEFAULTS = SamplerSection(samples=100)


def default_settings(**changes):
    given = {
        "n_chains": DEFAULTS.chains,
        "n_warmup": DEFAULTS.warmup,
        "n_draws": DEFAULTS.draws,
        "most_draws": DEFAULTS.most_draws,
        "n_samples": DEFAULTS.samples,
    }
    return SamplerSettings(**{**given, **changes})


def some_answers(n, with_ties=False):
    rng = np.random.default_rng(n)
    signs = rng.choice([-1.0, 0.0, 1.0] if with_ties else [-1.0, 1.0], n)
    return ComparisonSet(rng.normal(0, 0.1, (n, 4)), signs)


def all_draws(seed, model, comparisons, n_draws=500):
    """The same draws, from the same stream."""
    rng = np.random.default_rng(seed)
    target = Target(PRIOR, model, comparisons)
    return target, run_chains(rng, target, learn_proposal(rng, target, 200, 4), n_draws).points


@pytest.mark.parametrize("n_answers", [0, 12])
@pytest.mark.parametrize("n_samples", [2, 100, 2000])
def test_the_samples_are_evenly_spaced_among_all_draws_with_their_own_parameters(n_answers, n_samples):
    settings = SamplerSettings(4, 200, 500, 500, n_samples)
    comparisons = some_answers(n_answers, with_ties=True)
    posterior = infer(np.random.default_rng(1), PRIOR, INFERRED, comparisons, settings)
    target, points = all_draws(1, INFERRED, comparisons)
    flat = points.reshape(-1, 6)
    kept = flat[[round(i * (len(flat) - 1) / (n_samples - 1)) for i in range(n_samples)]]
    np.testing.assert_array_equal(posterior.samples, target.weights(kept))
    expected = target.parameters(kept)
    for name in ("rationality", "lapse_rate", "tie_threshold"):
        np.testing.assert_array_equal(getattr(posterior.parameters, name), getattr(expected, name))
        assert len(np.unique(getattr(expected, name))) > 1


def test_the_samples_carry_their_own_log_densities():
    comparisons = some_answers(12, with_ties=True)
    posterior = infer(np.random.default_rng(3), PRIOR, INFERRED, comparisons, ONE_ROUND)
    rows = posterior.parameters
    expected = references.log_likelihoods(
        comparisons.feature_diffs,
        comparisons.signs,
        posterior.samples,
        rows.rationality,
        rows.lapse_rate,
        rows.tie_threshold,
    )
    for name in INFERRED.inferred:
        prior, values = PARAMETER_PRIORS[name], getattr(rows, name)
        transformed = np.log(values / (1.0 - values)) if prior.transform == "logit" else np.log(values)
        expected = (
            expected + stats.norm(prior.location, prior.scale).logpdf(transformed) + np.log(prior.scale)
        )
    differences = posterior.log_densities - expected
    np.testing.assert_allclose(differences, differences[0], rtol=0, atol=1e-8)


def test_fixed_parameters_are_constant_columns():
    posterior = infer(np.random.default_rng(3), PRIOR, MODEL, some_answers(5), ONE_ROUND)
    assert set(posterior.parameters.rationality) == {50.0}
    assert set(posterior.parameters.lapse_rate) == {0.1}
    assert set(posterior.parameters.tie_threshold) == {0.0}
    assert len(posterior.parameters) == 100


def test_parameters_chosen_by_the_evidence_are_constant_columns_too():
    model = ResponseModel("sigmoid", "evidence", 0.1)
    posterior = infer(np.random.default_rng(3), PRIOR, model, some_answers(5), ONE_ROUND)
    assert len(set(posterior.parameters.rationality)) == 1
    assert set(posterior.parameters.lapse_rate) == {0.1}


def test_mean_and_diagnostics_are_of_all_draws_and_not_of_the_samples():
    comparisons = some_answers(12)
    model = ResponseModel("sigmoid", "inferred", 0.1)
    posterior = infer(np.random.default_rng(2), PRIOR, model, comparisons, ONE_ROUND)
    target, points = all_draws(2, model, comparisons)
    weights = target.weights(points.reshape(-1, 4)).reshape(4, 500, 4)
    np.testing.assert_allclose(posterior.mean, weights.mean(axis=(0, 1)), rtol=0, atol=1e-14)
    assert not np.allclose(posterior.mean, posterior.samples.mean(axis=0), rtol=0, atol=1e-6)
    log_rationality = np.log(target.parameters(points.reshape(-1, 4)).rationality).reshape(4, 500)
    found = posterior.diagnostics
    assert (len(found.r_hat), found.n_draws) == (5, 2000)
    for k, draws in enumerate([*np.moveaxis(weights, 2, 0), log_rationality]):
        assert found.r_hat[k] == pytest.approx(float(arviz.rhat(draws, method="rank")), rel=1e-9)
        assert found.ess_bulk[k] == pytest.approx(float(arviz.ess(draws, method="bulk")), rel=1e-9)
        assert found.ess_tail[k] == pytest.approx(float(arviz.ess(draws, method="tail")), rel=1e-9)


def test_the_same_stream_gives_the_same_posterior_to_the_last_bit():
    first, second = (
        infer(stream(3, "posterior", 1, 12), PRIOR, INFERRED, some_answers(12, True), ONE_ROUND)
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.samples, second.samples)
    np.testing.assert_array_equal(first.parameters.rationality, second.parameters.rationality)
    np.testing.assert_array_equal(first.mean, second.mean)
    np.testing.assert_array_equal(first.diagnostics.r_hat, second.diagnostics.r_hat)


def diagnosed_as(monkeypatch, n_enough):
    """Diagnostics that are satisfied by so many draws; returns how many there were each time."""
    seen = []

    def diagnose(draws, acceptance):
        n = draws.shape[0] * draws.shape[1]
        seen.append(n)
        size = 2000.0 if n >= n_enough else 10.0
        return Diagnostics(np.ones(4), np.full(4, size), np.full(4, size), acceptance, n)

    monkeypatch.setattr(run, "diagnose", diagnose)
    return seen


@pytest.mark.parametrize(
    ("n_enough", "expected"), [(400, [400]), (401, [400, 800]), (1700, [400, 800, 1600, 3200])]
)
def test_draws_double_until_the_diagnostics_are_satisfied(monkeypatch, n_enough, expected):
    seen = diagnosed_as(monkeypatch, n_enough)
    posterior = infer(np.random.default_rng(1), PRIOR, MODEL, some_answers(3), default_settings(n_draws=100))
    assert seen == expected
    assert posterior.diagnostics.has_converged
    assert posterior.diagnostics.warning is None


def test_at_the_most_draws_an_update_ends_with_a_warning(monkeypatch):
    seen = diagnosed_as(monkeypatch, 10**9)
    settings = default_settings(n_draws=100, most_draws=250)
    posterior = infer(np.random.default_rng(1), PRIOR, MODEL, some_answers(3), settings)
    assert seen == [400, 800, 1000]
    assert not posterior.diagnostics.has_converged
    assert "After 1000 draws" in posterior.diagnostics.warning


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("support", "model"),
    [
        ("sphere", ResponseModel("sigmoid", 200.0, 0.1)),
        ("ball", ResponseModel("sigmoid", 50.0)),
        ("ball", ResponseModel("clipped-linear", 1.0)),
        ("sphere", ResponseModel("sigmoid", "inferred", "inferred")),
    ],
    ids=["quickstart", "katz2021", "katz2021-code", "inferred"],
)
@pytest.mark.parametrize("n_answers", [0, 1, 10, 100])
def test_every_update_converges_and_few_need_more_than_the_default_draws(support, model, n_answers):
    case = Case(support, rationality=model.rationality if isinstance(model.rationality, float) else 60.0)
    n_more = 0
    for seed in range(5):
        comparisons = brute_force.answers(case, n_answers)
        posterior = infer(
            np.random.default_rng(seed), Prior(support, 4), model, comparisons, default_settings()
        )
        assert posterior.diagnostics.has_converged, posterior.diagnostics
        n_more += posterior.diagnostics.n_draws > 4 * DEFAULTS.draws
    assert n_more <= 2


@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_every_sample_lies_in_the_support(support):
    model = ResponseModel("sigmoid", 60.0, 0.1)
    posterior = infer(np.random.default_rng(5), Prior(support, 4), model, some_answers(20), ONE_ROUND)
    lengths = np.linalg.norm(posterior.samples, axis=1)
    assert (posterior.samples >= 0).all()
    assert (lengths <= 1 + 1e-12).all()
    if support == "sphere":
        np.testing.assert_allclose(lengths, 1.0, rtol=0, atol=1e-12)


def test_without_answers_every_log_likelihood_is_zero():
    posterior = infer(np.random.default_rng(3), PRIOR, MODEL, ComparisonSet.empty(4), ONE_ROUND)
    np.testing.assert_allclose(posterior.log_densities, 0.0, rtol=0, atol=1e-12)
