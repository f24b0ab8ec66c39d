"""The sampler against brute force: exact prior draws weighted by a likelihood that is written here."""

import math
from functools import lru_cache

import arviz
import numpy as np
import pytest

from study_core import choice_kernels
from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior import kernels, metropolis
from study_core.posterior.diagnostics import diagnose
from study_core.posterior.metropolis import run_chains
from study_core.posterior.prior import Prior
from study_core.streams import stream
from study_core.study import SamplerSection
from tests.study_core import references

N_BRUTE_FORCE = 400_000
MODELS = {
    "sigmoid": ResponseModel("sigmoid", 30.0),
    "lapse": ResponseModel("sigmoid", 60.0, 0.1),
    "clipped-linear": ResponseModel("clipped-linear", 3.0),
}


def answers(model, n):
    """Answers of someone with w = (.6, .1, .7, .35) to random pairs, with the odd mistake."""
    rng = np.random.default_rng(100 + n)
    diffs = rng.normal(0.0, 0.1, (n, 4))
    log_odds = model.rationality * diffs @ np.array([0.6, 0.1, 0.7, 0.35])
    is_a = rng.random(n) < 1 / (1 + np.exp(-log_odds))
    is_a ^= rng.random(n) < model.lapse_rate / 2
    return ComparisonSet(diffs, np.where(is_a, 1.0, -1.0))


@lru_cache(maxsize=2)
def brute_force_points(support):
    return references.prior_draws(np.random.default_rng(77), support, N_BRUTE_FORCE)


def brute_force_weights(model, points, comparisons):
    """p(answers | w) of each point, up to a constant, in pieces that fit in memory."""
    totals = np.empty(len(points))
    preferred = comparisons.feature_diffs * comparisons.signs[:, None]
    for start in range(0, len(points), 20_000):
        part = slice(start, start + 20_000)
        terms = references.log_answer_probability(
            model.name, model.rationality, model.lapse_rate, points[part] @ preferred.T
        )
        totals[part] = terms.sum(axis=1)
    return np.exp(totals - totals.max())


def functions_of(weights):
    """What is compared: all first and second moments, the length, two tails and one ordering."""
    pairs = np.triu_indices(weights.shape[1])
    return np.column_stack(
        [
            weights,
            weights[:, pairs[0]] * weights[:, pairs[1]],
            np.sqrt((weights**2).sum(axis=1)),
            weights[:, 0] > 0.6,
            weights[:, 1] < 0.1,
            weights[:, 0] > weights[:, 2],
        ]
    )


def estimate_of_chains(draws):
    """Mean of each function and its standard error, by arviz's effective sample sizes."""
    n_chains, n_draws, _ = draws.shape
    values = functions_of(draws.reshape(-1, draws.shape[2])).astype(float)
    means, spreads = values.mean(axis=0), values.std(axis=0)
    sizes = np.array(
        [
            float(arviz.ess(column.reshape(n_chains, n_draws), method="mean")) if spread > 1e-9 else np.inf
            for column, spread in zip(values.T, spreads, strict=True)
        ]
    )
    return means, spreads / np.sqrt(sizes), sizes


def draw(model, support, comparisons, seed=5, n_draws=10_000):
    return run_chains(np.random.default_rng(seed), Prior(support, 4), model, comparisons, 4, 1000, n_draws)


def assert_same(first, second):
    (means, errors), (other_means, other_errors) = first, second
    allowed = 4.5 * np.sqrt(errors**2 + other_errors**2) + 1e-9
    assert (np.abs(means - other_means) < allowed).all(), (means - other_means) / allowed


@pytest.mark.statistical
@pytest.mark.parametrize("n_answers", [0, 5, 100])
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_the_posterior_is_what_brute_force_gives(support, name, n_answers):
    model = MODELS[name]
    comparisons = answers(model, n_answers)
    points = brute_force_points(support)
    weights = brute_force_weights(model, points, comparisons)
    assert weights.sum() ** 2 / (weights**2).sum() > 1500, "too few brute-force draws to say anything"
    means, errors, sizes = estimate_of_chains(draw(model, support, comparisons).weights)
    assert sizes.min() > 500, "too few draws to say anything"
    expected = references.standard_error_of_weighted_mean(functions_of(points).astype(float), weights)
    assert_same((means, errors), expected)


@pytest.mark.statistical
def test_different_seeds_agree():
    model = MODELS["lapse"]
    comparisons = answers(model, 40)
    first, second = (
        estimate_of_chains(draw(model, "sphere", comparisons, seed, 5000).weights)[:2] for seed in (1, 2)
    )
    assert_same(first, second)
    assert not np.array_equal(first[0], second[0])


@pytest.mark.statistical
@pytest.mark.parametrize("support", ["ball", "sphere"])
@pytest.mark.parametrize("name", MODELS)
def test_a_few_steps_from_exact_draws_leave_the_distribution_as_it_is(support, name):
    """What every correct Metropolis step does; a slip in the acceptance or the density drifts away at once."""
    model, prior = MODELS[name], Prior(support, 4)
    comparisons = answers(model, 3)
    rng = np.random.default_rng(31)
    candidates = references.prior_draws(rng, support, 200_000)
    terms = references.log_answer_probability(
        model.name, model.rationality, model.lapse_rate, candidates @ comparisons.preferred_diffs.T
    )
    # Every likelihood is at most 1, so accepting with that probability gives exact posterior draws.
    exact = candidates[rng.random(len(candidates)) < np.exp(terms.sum(axis=1))][:15_000]
    points = np.ascontiguousarray(prior.coordinates(exact)).copy()
    log_densities = prior.log_density(points) + model.log_likelihood(exact, comparisons)
    packed, n_answers = choice_kernels.pack(comparisons.preferred_diffs)
    target = (prior.kernel_support, model.kernel_kind, packed, n_answers, model.rationality, model.lapse_rate)
    n = prior.n_coordinates
    draws, _, acceptance = kernels.sample(
        target,
        points,
        log_densities,
        0.2 * np.eye(n),
        rng.standard_normal((4, len(exact), n)),
        rng.standard_exponential((4, len(exact))),
    )
    assert 0.1 < acceptance < 0.9
    before = functions_of(exact).astype(float)
    after = functions_of(prior.weights(np.ascontiguousarray(draws[:, -1]))).astype(float)
    change = after - before
    error = change.std(axis=0) / math.sqrt(len(exact))
    assert (np.abs(change.mean(axis=0)) < 4.5 * error + 1e-12).all(), change.mean(axis=0) / error


@pytest.mark.parametrize("support", ["ball", "sphere"])
@pytest.mark.parametrize("name", MODELS)
def test_every_draw_lies_in_the_support_with_its_own_log_likelihood(support, name):
    model = MODELS[name]
    comparisons = answers(model, 20)
    chains = draw(model, support, comparisons, n_draws=300)
    flat = chains.weights.reshape(-1, 4)
    lengths = np.linalg.norm(flat, axis=1)
    assert chains.weights.shape == (4, 300, 4)
    assert (flat >= 0).all()
    assert (lengths <= 1 + 1e-12).all()
    if support == "sphere":
        np.testing.assert_allclose(lengths, 1.0, rtol=0, atol=1e-12)
    expected = references.log_answer_probability(
        model.name, model.rationality, model.lapse_rate, flat @ comparisons.preferred_diffs.T
    ).sum(axis=1)
    np.testing.assert_allclose(chains.log_likelihoods.ravel(), expected, rtol=0, atol=1e-9)


def test_the_same_stream_gives_the_same_chains():
    model = MODELS["lapse"]
    comparisons = answers(model, 20)
    first, second = (
        run_chains(stream(3, "posterior", 1, 20), Prior("sphere", 4), model, comparisons, 4, 200, 300)
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.weights, second.weights)
    np.testing.assert_array_equal(first.log_likelihoods, second.log_likelihoods)
    assert first.acceptance == second.acceptance


def spied_on(monkeypatch, comparisons, model, n_chains=16):
    """What passes between warm-up and sampling."""
    seen = {}
    adapt, sample = kernels.adapt, kernels.sample

    def adapt_seen(target, points, *rest):
        seen["starts"] = points.copy()
        seen["factor"] = adapt(target, points, *rest)
        return seen["factor"]

    def sample_seen(target, points, log_densities, factor, normals, exponentials):
        given = (points.copy(), log_densities.copy())
        seen["points"] = points.copy()
        seen["used"], before = factor, factor.copy()
        drawn = sample(target, points, log_densities, factor, normals, exponentials)
        again = sample(target, *given, before, normals, exponentials)
        seen["is_pure"] = np.array_equal(drawn[0], again[0]) and drawn[2] == again[2]
        seen["is_unchanged"] = np.array_equal(factor, before)
        seen["normals"], seen["draws"] = normals, drawn[0]
        return drawn

    monkeypatch.setattr(metropolis.kernels, "adapt", adapt_seen)
    monkeypatch.setattr(metropolis.kernels, "sample", sample_seen)
    run_chains(np.random.default_rng(4), Prior("sphere", 4), model, comparisons, n_chains, 400, 200)
    return seen


def test_the_proposal_is_learned_before_sampling_and_never_while_sampling(monkeypatch):
    seen = spied_on(monkeypatch, answers(MODELS["sigmoid"], 100), MODELS["sigmoid"])
    assert seen["used"] is seen["factor"]
    assert seen["is_unchanged"]
    assert seen["is_pure"]
    # Every move that was made is the one fixed factor times the step's own normal variates.
    path = np.concatenate([seen["points"][:, None], seen["draws"]], axis=1)
    moves = np.diff(path, axis=1)
    proposed = np.einsum("ij,tcj->cti", seen["factor"], seen["normals"])
    has_moved = moves.any(axis=2)
    assert 0.1 < has_moved.mean() < 0.7
    np.testing.assert_allclose(moves[has_moved], proposed[has_moved], rtol=0, atol=1e-12)


@pytest.mark.parametrize("rationality", [1.0, 30.0, 1e5])
def test_no_two_chains_start_alike_however_sharp_the_posterior(monkeypatch, rationality):
    model = ResponseModel("sigmoid", rationality)
    starts = spied_on(monkeypatch, answers(MODELS["sigmoid"], 100), model)["starts"]
    assert len(np.unique(starts, axis=0)) == 16
    assert (starts >= 0).all()
    assert (starts.sum(axis=1) <= 1).all()


@pytest.mark.statistical
def test_without_answers_the_starts_are_spread_over_the_prior(monkeypatch):
    starts = spied_on(monkeypatch, ComparisonSet.empty(4), MODELS["sigmoid"])["starts"]
    weights = Prior("sphere", 4).weights(starts)
    cosines = (weights @ weights.T)[np.triu_indices(16, k=1)]
    assert cosines.min() < 0.4


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("support", "model"),
    [
        ("sphere", ResponseModel("sigmoid", 200.0, 0.1)),
        ("ball", ResponseModel("sigmoid", 50.0)),
        ("ball", ResponseModel("clipped-linear", 1.0)),
    ],
    ids=["quickstart", "katz2021", "katz2021-code"],
)
@pytest.mark.parametrize("n_answers", [0, 1, 10, 100])
def test_the_default_draws_are_usable_and_twice_as_many_converge(support, model, n_answers):
    default = SamplerSection(samples=100)
    for seed in range(3):
        comparisons = answers(model, n_answers)
        for n_draws in (default.draws, 2 * default.draws):
            rng = np.random.default_rng(seed)
            chains = run_chains(
                rng, Prior(support, 4), model, comparisons, default.chains, default.warmup, n_draws
            )
            found = diagnose(chains.weights, chains.acceptance)
            assert found.r_hat.max() < 1.03, found
            assert min(found.ess_bulk.min(), found.ess_tail.min()) > 150, found
            assert 0.15 < found.acceptance < 0.5
        assert found.has_converged, found


@pytest.mark.statistical
def test_many_answers_find_the_truth():
    model, truth = ResponseModel("sigmoid", 200.0, 0.1), np.array([0.6, 0.1, 0.7, 0.35])
    truth /= np.linalg.norm(truth)
    chains = draw(model, "sphere", answers(model, 1000), n_draws=2000)
    mean = chains.weights.reshape(-1, 4).mean(axis=0)
    assert mean @ truth / np.linalg.norm(mean) > 0.995
