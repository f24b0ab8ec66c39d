"""Simulation-based calibration (Talts et al. 2018), and planted errors that the same test finds.

Where people are drawn from the prior and answer by the model, the true value's rank among the posterior's samples is
uniform, for every quantity: each weight, each inferred parameter, and the log-likelihood of the answers, which sees
errors that the others don't (Modrák et al. 2023).
"""

from functools import lru_cache

import numpy as np
import pytest
from scipy.stats import binom, chisquare

from study_core import choice_kernels
from study_core.choice import PARAMETER_PRIORS, ParameterPrior, ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior import target as target_module
from study_core.posterior.prior import Prior
from study_core.posterior.run import SamplerSettings, infer
from tests.study_core import references
from tests.study_core.posterior import brute_force
from tests.study_core.posterior.brute_force import Case

N_DATA_SETS = 600
N_SAMPLES = 99
N_BINS = 20
N_ANSWERS = 25
SETTINGS = SamplerSettings(4, 200, 750, 3000, N_SAMPLES)
# The smallest p-value over all quantities of a case, times their number, is below this in one of six cases once in a
# hundred suites. (With 2,500 data sets each, five of the cases were looked at once: from 0.33 upwards.)
SMALLEST_P = 0.01 / 6

CASES = {
    "sphere with lapses": Case("sphere", rationality=200.0, lapse_rate=0.1),
    "ball": Case("ball", rationality=50.0),
    "rationality and lapses inferred": Case("sphere", rationality=None, lapse_rate=None),
    "rationality inferred on the ball": Case("ball", rationality=None, lapse_rate=0.05),
    "everything inferred": Case("sphere", rationality=None, lapse_rate=None, tie_threshold=None),
    "seven features": Case("sphere", 7, rationality=100.0, lapse_rate=None),
}


def simulate(case, rng):
    """One person with their answers, by the equations alone."""
    weights = references.prior_draws(rng, case.support, 1, case.d)[0]
    parameters = [column[0] for column in brute_force.prior_parameters(case, rng, 1)]
    rationality, lapse_rate, tie_threshold = parameters
    diffs = rng.normal(0.0, 0.1, (N_ANSWERS, case.d))
    utilities = rationality * diffs @ weights
    # A logistic variate decides: A above the threshold, B below minus the threshold, between them about the same.
    noise = np.log(1.0 / rng.random(N_ANSWERS) - 1.0)
    threshold = tie_threshold if case.has_ties else 0.0
    answers = _ordered(utilities + noise, threshold)
    lapses = rng.random(N_ANSWERS) < lapse_rate
    answers[lapses] = rng.choice([-1.0, 0.0, 1.0] if case.has_ties else [-1.0, 1.0], lapses.sum())
    return weights, parameters, ComparisonSet(diffs, answers)


def _ordered(latent, threshold):
    return np.where(latent > threshold, 1.0, np.where(latent < -threshold, -1.0, 0.0))


def ranks(case, response, n_data_sets=N_DATA_SETS):
    """Rank of the truth among the samples, of every quantity, for every data set."""
    rows = []
    for number in range(n_data_sets):
        rng = np.random.default_rng([2018, number])
        weights, parameters, comparisons = simulate(case, rng)
        posterior = infer(rng, Prior(case.support, case.d), response, comparisons, SETTINGS)
        columns = posterior.parameters
        sampled = [*posterior.samples.T, columns.rationality, columns.lapse_rate, columns.tie_threshold]
        truths = [*weights, *parameters]
        given = [None] * case.d + [case.rationality, case.lapse_rate, case.tie_threshold]
        row = [
            (column < truth).sum()
            for column, truth, fixed in zip(sampled, truths, given, strict=True)
            if fixed is None
        ]
        args = (comparisons.feature_diffs, comparisons.signs)
        true_log = references.log_likelihoods(*args, weights[None], *(np.array([p]) for p in parameters))
        own = references.log_likelihoods(
            *args, posterior.samples, columns.rationality, columns.lapse_rate, columns.tie_threshold
        )
        rows.append([*row, (own < true_log).sum()])
    return np.array(rows)


def smallest_p(ranks):
    """The smallest p-value of all quantities, corrected for their number; two tests of each.

    Chi-square over bins, and the farthest the ranks' distribution function strays from its own binomial range.
    """
    n, n_quantities = ranks.shape
    p_values = []
    for column in ranks.T:
        counts = np.bincount(column * N_BINS // (N_SAMPLES + 1), minlength=N_BINS)
        p_values.append(chisquare(counts).pvalue)
        p_values.append(_p_of_largest_stray(column, n))
    return min(p_values) * 2 * n_quantities


def _largest_stray(ranks):
    """The smallest pointwise binomial p-value of each row's distribution function."""
    places = np.arange(1, N_BINS) * (N_SAMPLES + 1) // N_BINS
    counts = np.stack([(ranks < place).sum(axis=-1) for place in places], axis=-1)
    chances, n = places / (N_SAMPLES + 1), ranks.shape[-1]
    return np.minimum(binom.cdf(counts, n, chances), binom.sf(counts - 1, n, chances)).min(axis=-1)


@lru_cache(maxsize=1)
def _strays_of_uniform_ranks(n):
    return _largest_stray(np.random.default_rng(1).integers(0, N_SAMPLES + 1, (20_000, n)))


def _p_of_largest_stray(column, n):
    """How often uniform ranks stray as far anywhere (Säilynoja et al. 2022)."""
    simulated = _strays_of_uniform_ranks(n)
    return float((1 + (simulated <= _largest_stray(column)).sum()) / (1 + len(simulated)))


def response_of(case):
    settings = (case.rationality, case.lapse_rate, case.tie_threshold)
    return ResponseModel("sigmoid", *("inferred" if value is None else value for value in settings))


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.parametrize("name", CASES)
def test_the_truth_has_a_uniform_rank_among_the_samples(name):
    assert smallest_p(ranks(CASES[name], response_of(CASES[name]))) > SMALLEST_P


def flip_signs(monkeypatch):
    monkeypatch.setattr(target_module, "pack", lambda diffs, signs: choice_kernels.pack(diffs, -1.0 * signs))


def take_a_narrower_prior(monkeypatch):
    monkeypatch.setitem(PARAMETER_PRIORS, "rationality", ParameterPrior("log", float(np.log(50.0)), 0.75))


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.parametrize("plant", [flip_signs, take_a_narrower_prior])
def test_a_planted_error_in_the_code_is_caught_by_the_ranks(monkeypatch, plant):
    case = CASES["rationality and lapses inferred"]
    plant(monkeypatch)
    assert smallest_p(ranks(case, response_of(case))) < SMALLEST_P


@pytest.mark.slow
@pytest.mark.statistical
def test_a_planted_missing_lapse_is_caught_by_the_ranks():
    case = CASES["sphere with lapses"]
    assert smallest_p(ranks(case, ResponseModel("sigmoid", 200.0, 0.0))) < SMALLEST_P


@pytest.mark.slow
@pytest.mark.statistical
def test_a_planted_wrong_prior_of_the_weights_is_caught_by_the_ranks(monkeypatch):
    """People most of whom care for one thing alone, where the model has them care for everything alike."""
    case = CASES["sphere with lapses"]

    def one_sided(rng, support, n, d):
        weights = rng.random((n, d)) ** 4
        return weights / np.linalg.norm(weights, axis=1, keepdims=True)

    monkeypatch.setattr(references, "prior_draws", one_sided)
    assert smallest_p(ranks(case, response_of(case))) < SMALLEST_P


def test_uniform_ranks_pass_and_skewed_ones_do_not():
    rng = np.random.default_rng(3)
    uniform = rng.integers(0, N_SAMPLES + 1, (N_DATA_SETS, 5))
    assert smallest_p(uniform) > SMALLEST_P
    skewed = uniform.copy()
    skewed[:, 2] = (N_SAMPLES * rng.random(N_DATA_SETS) ** 1.4).astype(int)
    assert smallest_p(skewed) < SMALLEST_P
