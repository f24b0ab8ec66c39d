"""A posterior that starts from the people before, against brute force: draws of u, thrown away where negative."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import multivariate_normal, truncnorm

from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior.annealing import learn_proposal
from study_core.posterior.metropolis import run_chains
from study_core.posterior.population import PopulationPrior
from study_core.posterior.prior import Prior
from study_core.posterior.run import SamplerSettings, infer
from study_core.posterior.target import Target
from tests.study_core import references
from tests.study_core.posterior import brute_force

LARGEST_Z = 4.5
N_POINTS = 100_000
# An event that hardly ever happens may not happen at all in the draws of a chain, whose error would then be 0.
_RARE = 1e-3


def covariance(scales, correlation):
    """Every two features correlated by as much."""
    d = len(scales)
    return (correlation + (1 - correlation) * np.eye(d)) * np.outer(scales, scales)


@dataclass(frozen=True)
class Case:
    """A population in plain numbers, and how people answer; None is inferred."""

    mean: tuple[float, ...]
    scales: tuple[float, ...]
    correlation: float = 0.0
    lapse_rate: float | None = None
    tie_threshold: float | None = 0.0

    @property
    def population(self):
        return PopulationPrior(np.array(self.mean), covariance(np.array(self.scales), self.correlation))

    @property
    def response(self):
        settings = (self.lapse_rate, self.tie_threshold)
        return ResponseModel(
            "sigmoid", "inferred", *("inferred" if value is None else value for value in settings)
        )


CASES = {
    "people alike": Case((20.0, 30.0), (2.0, 3.0)),
    "people unlike": Case((20.0, 10.0), (40.0, 30.0), 0.3),
    "something that nobody likes": Case((-10.0, 30.0), (8.0, 20.0), -0.4, lapse_rate=0.1),
    "four features, people alike": Case((10.0, 25.0, 5.0, 40.0), (2.0, 4.0, 1.0, 5.0), 0.2),
    "four features, people unlike": Case((10.0, 25.0, -3.0, 40.0), (20.0, 30.0, 10.0, 15.0), 0.3),
    "ties": Case((20.0, 25.0, 5.0, 40.0), (10.0, 10.0, 10.0, 20.0), lapse_rate=0.1, tie_threshold=None),
}


def answers(case, n):
    """Answers to random pairs of somebody who is not quite like the others; with ties, some can't tell."""
    rng = np.random.default_rng(300 + n)
    truth = np.abs(np.array(case.mean)) + 3.0
    diffs = rng.normal(0.0, 0.1, (n, len(truth)))
    utilities = diffs @ truth
    signs = np.where(rng.random(n) < expit(utilities), 1.0, -1.0)
    if case.tie_threshold is None:
        signs[np.abs(utilities) < 1.0] = 0.0
    return ComparisonSet(diffs, signs)


def estimate(case, comparisons):
    """Means and their standard errors over draws of the population, weighted by the likelihood."""
    rng = np.random.default_rng(9)
    drawn = rng.multivariate_normal(
        case.mean, covariance(np.array(case.scales), case.correlation), 10 * N_POINTS
    )
    utilities = drawn[(drawn > 0.0).all(axis=1)][:N_POINTS]
    n = len(utilities)
    assert n > 20_000
    rationality = np.linalg.norm(utilities, axis=1)
    lapse_rate = (
        1 / (1 + np.exp(3.0 - rng.standard_normal(n))) if case.lapse_rate is None else np.full(n, 0.1)
    )
    ties = np.exp(rng.standard_normal(n)) if case.tie_threshold is None else np.zeros(n)
    weights = utilities / rationality[:, None]
    totals = np.concatenate(
        [
            references.log_likelihoods(
                comparisons.feature_diffs,
                comparisons.signs,
                weights[part],
                rationality[part],
                lapse_rate[part],
                ties[part],
            )
            for part in np.array_split(np.arange(n), 20)
        ]
    )
    shares = np.exp(totals - totals.max())
    assert shares.sum() ** 2 / (shares**2).sum() > 400, "too few brute-force draws to say anything"
    values = brute_force.functions_of(weights, (rationality, lapse_rate, ties))
    return references.standard_error_of_weighted_mean(values, shares)


def estimate_of_product(case, comparisons, population, n_draws=4000):
    rng = np.random.default_rng(5)
    d = len(case.mean)
    target = Target(Prior("sphere", d, population), case.response, comparisons)
    points = run_chains(rng, target, learn_proposal(rng, target, 200, 4), n_draws).points
    flat = points.reshape(-1, target.n_coordinates)
    rows = target.parameters(flat)
    parameters = (rows.rationality, rows.lapse_rate, rows.tie_threshold)
    return brute_force.estimate_of_chains(target.weights(flat).reshape(4, n_draws, d), parameters)


@pytest.mark.statistical
@pytest.mark.parametrize(("name", "n_answers"), [(name, n) for name in CASES for n in (0, 25)])
def test_the_posterior_is_what_brute_force_gives(name, n_answers):
    case = CASES[name]
    comparisons = answers(case, n_answers)
    assert case.tie_threshold == 0.0 or n_answers < 25 or (comparisons.signs == 0.0).any()
    means, errors = estimate(case, comparisons)
    found, found_errors = estimate_of_product(case, comparisons, case.population)
    is_usual = np.abs(means) > _RARE
    assert is_usual.sum() > 8
    compared = (found[is_usual], found_errors[is_usual]), (means[is_usual], errors[is_usual])
    assert brute_force.largest_z(*compared) < LARGEST_Z


@pytest.mark.statistical
@pytest.mark.parametrize(
    "wrong",
    [
        None,
        PopulationPrior(np.array([22.0, 10.0]), covariance(np.array([40.0, 30.0]), 0.3)),
        PopulationPrior(np.array([20.0, 10.0]), covariance(np.array([40.0, 30.0]), 0.0)),
    ],
    ids=["forgotten", "another mean", "another covariance"],
)
def test_a_wrong_population_is_caught_by_brute_force(wrong):
    case = CASES["people unlike"]
    comparisons = answers(case, 5)
    assert brute_force.largest_z(
        estimate_of_product(case, comparisons, wrong, 20_000), estimate(case, comparisons)
    ) > (1.5 * LARGEST_Z)


@pytest.mark.statistical
def test_without_answers_utilities_are_a_normal_cut_off_at_0():
    """Independent ones by scipy's truncated normal, correlated ones on a grid."""
    settings = SamplerSettings(n_chains=4, n_warmup=200, n_draws=4000, most_draws=16_000, n_samples=16_000)
    none = ComparisonSet.empty(2)
    for correlation in (0.0, 0.5):
        case = Case((-5.0, 20.0), (10.0, 15.0), correlation, lapse_rate=0.1)
        prior = Prior("sphere", 2, case.population)
        posterior = infer(np.random.default_rng(2), prior, case.response, none, settings)
        assert posterior.diagnostics.has_converged
        utilities = posterior.samples * posterior.parameters.rationality[:, None]
        if correlation == 0.0:
            expected = [
                truncnorm(-mean / scale, np.inf, mean, scale).mean()
                for mean, scale in zip(case.mean, case.scales, strict=True)
            ]
        else:
            grid = np.stack(np.meshgrid(np.linspace(0, 60, 601), np.linspace(0, 110, 601)), axis=-1)
            density = multivariate_normal(case.mean, case.population.covariance).pdf(grid)
            expected = np.einsum("ij,ijk->k", density, grid) / density.sum()
        np.testing.assert_allclose(utilities.mean(axis=0), expected, rtol=0.03)


@pytest.mark.parametrize("factor", [1e-2, 1e2])
def test_what_people_care_for_may_be_tiny_or_huge(factor):
    """Far from the rationality that the study's own prior expects."""
    mean = factor * np.array([20.0, 30.0])
    population = PopulationPrior(mean, np.diag((0.1 * mean) ** 2))
    settings = SamplerSettings(n_chains=4, n_warmup=200, n_draws=500, most_draws=8000, n_samples=500)
    prior, response = Prior("sphere", 2, population), ResponseModel("sigmoid", "inferred")
    posterior = infer(np.random.default_rng(1), prior, response, ComparisonSet.empty(2), settings)
    assert posterior.diagnostics.has_converged
    rationality = float(np.median(posterior.parameters.rationality))
    assert rationality == pytest.approx(np.linalg.norm(mean), rel=0.05)


def test_a_population_needs_the_sphere_and_a_rationality_of_ones_own():
    population = CASES["people alike"].population
    for prior, response in (
        (Prior("ball", 2, population), ResponseModel("sigmoid", "inferred")),
        (Prior("sphere", 2, population), ResponseModel("sigmoid", 50.0)),
    ):
        with pytest.raises(AssertionError):
            _ = Target(prior, response, ComparisonSet.empty(2)).for_kernels
