"""The warm-up ends close to the posterior, and its starts don't know each other."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior import annealing
from study_core.posterior.annealing import learn_from_draws, learn_proposal
from study_core.posterior.metropolis import run_chains
from study_core.posterior.mixture import Mixture
from study_core.posterior.prior import Prior
from study_core.posterior.target import Target
from tests.study_core.posterior import brute_force
from tests.study_core.posterior.brute_force import Case


def target_of(n_answers, rationality=60.0, lapse_rate=0.1, support="sphere", d=4):
    case = Case(support, d, rationality=60.0, lapse_rate=0.1)
    comparisons = brute_force.answers(case, n_answers)
    return Target(Prior(support, d), ResponseModel("sigmoid", rationality, lapse_rate), comparisons)


def worth_of(target, proposal):
    """Share of the mixture's draws that they are worth as draws from the posterior."""
    points = proposal.mixture.draw(np.random.default_rng(1), 4000)
    log_priors, log_likelihoods = target.log_densities(points)
    log_ratios = log_priors + log_likelihoods - proposal.mixture.log_density(points)
    ratios = np.exp(log_ratios - log_ratios.max())
    return ratios.sum() ** 2 / (ratios**2).sum() / len(ratios)


@pytest.mark.statistical
@pytest.mark.parametrize("n_answers", [0, 1, 5, 20, 100, 1000])
@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_the_mixture_is_close_to_the_posterior(n_answers, support):
    target = target_of(n_answers, support=support)
    for seed in range(3):
        proposal = learn_proposal(np.random.default_rng(seed), target, 200, 4)
        assert worth_of(target, proposal) > 0.4


@pytest.mark.statistical
@pytest.mark.parametrize(("d", "smallest"), [(2, 0.8), (7, 0.3), (12, 0.05)])
def test_other_numbers_of_features_are_fitted_too(d, smallest):
    case = Case("sphere", min(d, 7), rationality=60.0, lapse_rate=0.1)
    comparisons = brute_force.answers(case, 100)
    padded = np.random.default_rng(1).normal(0, 0.1, (100, d))
    padded[:, : case.d] = comparisons.feature_diffs
    target = Target(
        Prior("sphere", d), ResponseModel("sigmoid", 60.0, 0.1), ComparisonSet(padded, comparisons.signs)
    )
    assert worth_of(target, learn_proposal(np.random.default_rng(2), target, 200, 4)) > smallest


def test_an_extremely_sharp_posterior_is_reached():
    """A rationality of 10,000 in 300 answers: a needle, a ten-thousandth of the prior or less."""
    comparisons = brute_force.answers(Case("sphere", rationality=1e4, lapse_rate=0.1), 300)
    target = Target(Prior("sphere", 4), ResponseModel("sigmoid", 1e4, 0.1), comparisons)
    proposal = learn_proposal(np.random.default_rng(3), target, 200, 4)
    assert (np.sqrt(np.diag(proposal.covariance)) < 0.1).all()
    assert worth_of(target, proposal) > 0.3


def are_spread(starts, covariance):
    """Whether the starts are different points, as far apart as draws of the posterior at least.

    The mean squared distance of independent draws is twice the trace of the covariance; a quarter of it for the
    starts happens with a probability far below one in a thousand.
    """
    n = len(starts)
    distances = ((starts[:, None] - starts[None]) ** 2).sum(axis=2)[np.triu_indices(n, k=1)]
    return bool(distances.min() > 0.0 and distances.mean() > 0.5 * np.trace(covariance))


@pytest.mark.parametrize("rationality", [1.0, 60.0, 1e4])
@pytest.mark.parametrize("n_answers", [0, 10, 100])
def test_the_starts_are_distinct_and_spread_however_sharp_the_posterior(rationality, n_answers):
    target = target_of(n_answers, rationality)
    proposal = learn_proposal(np.random.default_rng(4), target, 200, 16)
    assert proposal.starts.shape == (16, 3)
    assert are_spread(proposal.starts, proposal.covariance)


def test_planted_starts_that_are_all_alike_are_caught(monkeypatch):
    target = target_of(100)
    monkeypatch.setattr(
        annealing, "_distinct", lambda rng, weights, n_rows: np.full(n_rows, int(np.argmax(weights)))
    )
    proposal = learn_proposal(np.random.default_rng(4), target, 200, 16)
    assert not are_spread(proposal.starts, proposal.covariance)


def test_without_answers_one_stage_is_enough():
    target = Target(Prior("sphere", 4), ResponseModel("sigmoid", 200.0, 0.1), ComparisonSet.empty(4))
    assert worth_of(target, learn_proposal(np.random.default_rng(5), target, 200, 4)) > 0.7


@pytest.mark.statistical
def test_draws_that_have_not_converged_give_a_better_proposal_than_the_one_that_made_them():
    """From a mixture that misses half of the posterior, chains still find it and the next mixture knows it."""
    target, rng = target_of(20), np.random.default_rng(6)
    good = learn_proposal(rng, target, 200, 4)
    shifted = Mixture(np.ones(1), np.mean(good.starts, axis=0)[None] + 1.5, 0.3 * np.eye(3)[None])
    bad = replace(good, mixture=shifted)
    better = learn_from_draws(rng, run_chains(rng, target, bad, 2000).points)
    assert worth_of(target, bad) < 0.1
    assert worth_of(target, better) > 0.4
