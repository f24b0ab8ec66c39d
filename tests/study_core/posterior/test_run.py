"""The posterior keeps an even share of its draws and diagnoses all of them."""

import math

import numpy as np
import pytest

from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, ComparisonSet
from study_core.posterior.diagnostics import Diagnostics, diagnose
from study_core.posterior.metropolis import run_chains
from study_core.posterior.prior import Prior
from study_core.posterior.run import Posterior, SamplerSettings, infer

MODEL, PRIOR = ResponseModel("sigmoid", 50.0, 0.1), Prior("sphere", 4)
SETTINGS = SamplerSettings(n_chains=4, n_warmup=300, n_draws=500, n_samples=100)


def some_answers(n):
    rng = np.random.default_rng(n)
    return ComparisonSet(rng.normal(0, 0.1, (n, 4)), rng.choice([-1.0, 1.0], n))


@pytest.mark.parametrize("n_answers", [0, 12])
@pytest.mark.parametrize("n_samples", [2, 100, 2000])
def test_the_samples_are_evenly_spaced_among_all_draws(n_answers, n_samples):
    settings = SamplerSettings(4, 300, 500, n_samples)
    comparisons = some_answers(n_answers)
    posterior = infer(np.random.default_rng(1), PRIOR, MODEL, comparisons, settings)
    chains = run_chains(np.random.default_rng(1), PRIOR, MODEL, comparisons, 4, 300, 500)
    every = chains.weights.reshape(-1, 4)
    kept = [round(i * (len(every) - 1) / (n_samples - 1)) for i in range(n_samples)]
    np.testing.assert_array_equal(posterior.samples, every[kept])
    np.testing.assert_array_equal(posterior.log_likelihoods, chains.log_likelihoods.ravel()[kept])
    assert len(set(kept)) == n_samples


def test_every_chain_gives_its_share_of_the_samples():
    posterior = infer(np.random.default_rng(1), PRIOR, MODEL, some_answers(5), SETTINGS)
    chains = run_chains(np.random.default_rng(1), PRIOR, MODEL, some_answers(5), 4, 300, 500)
    shares = [
        sum(any(np.array_equal(sample, row) for row in chain) for sample in posterior.samples)
        for chain in chains.weights
    ]
    assert shares == [25, 25, 25, 25]


def test_mean_and_diagnostics_are_of_all_draws_and_not_of_the_samples():
    comparisons = some_answers(12)
    posterior = infer(np.random.default_rng(2), PRIOR, MODEL, comparisons, SETTINGS)
    chains = run_chains(np.random.default_rng(2), PRIOR, MODEL, comparisons, 4, 300, 500)
    np.testing.assert_allclose(posterior.mean, chains.weights.mean(axis=(0, 1)), rtol=0, atol=1e-14)
    assert not np.allclose(posterior.mean, posterior.samples.mean(axis=0), rtol=0, atol=1e-6)
    found = diagnose(chains.weights, chains.acceptance)
    np.testing.assert_array_equal(posterior.diagnostics.r_hat, found.r_hat)
    np.testing.assert_array_equal(posterior.diagnostics.ess_bulk, found.ess_bulk)
    np.testing.assert_array_equal(posterior.diagnostics.ess_tail, found.ess_tail)
    assert posterior.diagnostics.acceptance == chains.acceptance


def test_the_samples_carry_their_own_log_likelihoods():
    comparisons = some_answers(12)
    posterior = infer(np.random.default_rng(3), PRIOR, MODEL, comparisons, SETTINGS)
    np.testing.assert_allclose(
        posterior.log_likelihoods, MODEL.log_likelihood(posterior.samples, comparisons), rtol=0, atol=1e-9
    )


def test_without_answers_every_log_likelihood_is_zero():
    posterior = infer(np.random.default_rng(3), PRIOR, MODEL, ComparisonSet.empty(4), SETTINGS)
    np.testing.assert_allclose(posterior.log_likelihoods, 0.0, rtol=0, atol=1e-12)


def test_the_predicted_probability_averages_probabilities_and_not_weights():
    samples = np.array([[1.0, 0.0], [0.0, 1.0], [0.3, 0.3]])
    parameters = ResponseParameters(np.array([50.0, 5.0, 20.0]), np.array([0.1, 0.0, 0.2]), np.zeros(3))
    diagnostics = Diagnostics(np.ones(2), np.ones(2), np.ones(2), 0.3)
    posterior = Posterior(samples, parameters, np.zeros(3), samples.mean(axis=0), diagnostics)
    expected = [
        0.05 + 0.9 / (1 + math.exp(-50.0 * 0.1)),
        1 / (1 + math.exp(-5.0 * -0.02)),
        0.1 + 0.8 / (1 + math.exp(-20.0 * 0.3 * 0.08)),
    ]
    for choice, value in ((Choice.A, math.fsum(expected) / 3), (Choice.B, 1 - math.fsum(expected) / 3)):
        predicted = posterior.predicted_probability(choice, np.array([0.1, -0.02]))
        assert predicted == pytest.approx(value, abs=1e-15)
