"""The chains: what a correct step leaves alone, what is fixed before sampling, and what repeats bit for bit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior import kernels, metropolis, run
from study_core.posterior.annealing import Proposal, learn_from_draws, learn_proposal
from study_core.posterior.diagnostics import diagnose
from study_core.posterior.metropolis import run_chains
from study_core.posterior.mixture import Mixture
from study_core.posterior.prior import Prior
from study_core.posterior.target import Target
from study_core.streams import stream
from tests.study_core.posterior import brute_force
from tests.study_core.posterior.brute_force import Case

CASE = Case("sphere", rationality=60.0, lapse_rate=0.1)


def some_target(n_answers=40, response=None):
    response = response or ResponseModel("sigmoid", 60.0, 0.1)
    return Target(Prior("sphere", 4), response, brute_force.answers(CASE, n_answers))


def chains_of(target, seed=1, n_chains=4, n_draws=300):
    rng = np.random.default_rng(seed)
    return run_chains(rng, target, learn_proposal(rng, target, 200, n_chains), n_draws)


def exact_draws(target, rng, n):
    """Draws from the prior, accepted with the probability of the answers, which is at most 1."""
    case = Case(target.prior.support, rationality=60.0, lapse_rate=None)
    weights = target.prior.draw(rng, 400_000)
    parameters = [np.full(len(weights), 60.0), *brute_force.prior_parameters(case, rng, len(weights))[1:]]
    totals = brute_force.log_likelihoods(case, weights, parameters, target.comparisons)
    kept = np.flatnonzero(rng.random(len(weights)) < np.exp(totals))[:n]
    assert len(kept) == n
    logit = np.log(parameters[1] / (1 - parameters[1])) + 3.0
    return np.hstack([target.prior.coordinates(weights[kept]), logit[kept, None]])


@pytest.mark.statistical
@pytest.mark.parametrize("support", ["ball", "sphere"])
@pytest.mark.parametrize(("n_leaps", "n_steps"), [(1, 0), (0, 1), (2, 1)])
def test_a_few_sweeps_from_exact_draws_leave_the_distribution_as_it_is(support, n_leaps, n_steps):
    """What every correct step does; a slip in the acceptance or the density drifts away at once."""
    model = ResponseModel("sigmoid", 60.0, "inferred")
    target = Target(
        Prior(support, 4), model, brute_force.answers(Case(support, rationality=60.0, lapse_rate=0.1), 4)
    )
    rng = np.random.default_rng(31)
    n, d = 8000, target.n_coordinates
    exact = exact_draws(target, rng, n)
    # A proposal that is rather wrong, so that being right depends on the acceptance.
    mixture = Mixture(
        np.array([0.5, 0.5]), np.array([np.full(d, 0.5), np.full(d, -0.5)]), np.array([np.eye(d)] * 2)
    )
    leaps = mixture.draw(rng, n * 3 * n_leaps)
    draws, n_accepted = kernels.sample(
        target.for_kernels,
        exact.copy(),
        mixture.for_kernels,
        0.5 * np.eye(d),
        leaps.reshape(n, 3, n_leaps, d),
        mixture.log_density(leaps).reshape(n, 3, n_leaps),
        rng.standard_normal((n, 3, n_steps, d)),
        rng.standard_exponential((n, 3, n_leaps + n_steps)),
    )
    after = np.ascontiguousarray(draws[:, -1])
    assert (after != exact).any(axis=1).mean() > 0.2
    assert (n_accepted > 0) == (n_leaps > 0)

    def values(points):
        rows = target.parameters(points)
        return brute_force.functions_of(
            target.weights(points), (rows.rationality, rows.lapse_rate, rows.tie_threshold)
        )

    change = values(after) - values(exact)
    error = change.std(axis=0) / math.sqrt(n)
    assert (np.abs(change.mean(axis=0)) < 4.5 * error + 1e-12).all(), change.mean(axis=0) / error


def test_the_same_stream_gives_the_same_draws_to_the_last_bit():
    target = some_target()
    first, second = (
        run_chains(rng, target, learn_proposal(rng, target, 200, 4), 300)
        for rng in (stream(3, "posterior", 1, 20), stream(3, "posterior", 1, 20))
    )
    np.testing.assert_array_equal(first.points, second.points)
    assert first.acceptance == second.acceptance


def test_the_acceptance_is_the_share_of_leaps_that_moved(monkeypatch):
    monkeypatch.setattr(metropolis, "_SWEEPS_BEFORE_DRAWING", 0)
    monkeypatch.setattr(metropolis, "_N_LEAPS", 1)
    target, rng = some_target(), np.random.default_rng(1)
    proposal = learn_proposal(rng, target, 200, 4)
    # A random walk that goes nowhere: every move is a leap.
    still = replace(proposal, covariance=1e-300 * np.eye(3))
    chains = run_chains(rng, target, still, 500)
    path = np.concatenate([proposal.starts[:, None], chains.points], axis=1)
    has_moved = (np.abs(np.diff(path, axis=1)) > 1e-12).any(axis=2)
    assert chains.acceptance == pytest.approx(has_moved.mean(), abs=1e-12)
    assert 0.4 < chains.acceptance < 1.0


def test_every_chain_moves_on_its_own():
    draws = chains_of(some_target(), n_chains=6, n_draws=200).points
    assert len(np.unique(draws[:, -1], axis=0)) == 6
    assert (np.abs(np.diff(draws, axis=1)).sum(axis=(1, 2)) > 0).all()


def proposals_used(monkeypatch, draw):
    """Everything that decides how the chains propose, before and after every call of the kernel in one run."""
    seen, sample = [], kernels.sample

    def sample_seen(target, points, mixture, walk_factor, *variates):
        seen.append([np.copy(part) for part in (*mixture, walk_factor)])
        drawn = sample(target, points, mixture, walk_factor, *variates)
        seen.append([np.copy(part) for part in (*mixture, walk_factor)])
        return drawn

    monkeypatch.setattr(metropolis.kernels, "sample", sample_seen)
    draw()
    return seen


def are_fixed(seen, proposal):
    """Whether all draws of a run were proposed by what had been learned before it, and by that alone."""
    learned = [*proposal.mixture.for_kernels, 2.38 / np.sqrt(3) * np.linalg.cholesky(proposal.covariance)]
    return len(seen) > 0 and all(
        np.array_equal(part, first) for used in seen for part, first in zip(used, learned, strict=True)
    )


def test_the_proposal_is_learned_before_sampling_and_never_while_sampling(monkeypatch):
    target, rng = some_target(), np.random.default_rng(1)
    proposal = learn_proposal(rng, target, 200, 4)
    seen = proposals_used(monkeypatch, lambda: run_chains(rng, target, proposal, 300))
    assert are_fixed(seen, proposal)


def test_planted_adaptation_left_on_while_sampling_is_caught(monkeypatch):
    """Draws of one run that was made in three parts, each learning from the last."""
    target, rng = some_target(), np.random.default_rng(1)
    proposal = learn_proposal(rng, target, 200, 4)

    def draw_and_adapt():
        current = proposal
        for _ in range(3):
            current = learn_from_draws(rng, run_chains(rng, target, current, 100).points)

    assert not are_fixed(proposals_used(monkeypatch, draw_and_adapt), proposal)


def test_an_updates_draws_all_come_from_one_run(monkeypatch):
    """What is drawn before the proposal is learned anew never counts."""
    runs = []

    def run_seen(rng, target, proposal, n_draws):
        runs.append(run_chains(rng, target, proposal, n_draws))
        return runs[-1]

    monkeypatch.setattr(run, "run_chains", run_seen)
    monkeypatch.setattr(run.Diagnostics, "has_converged", property(lambda found: found.n_draws >= 1600))
    settings = run.SamplerSettings(4, 200, 100, 1000, 50)
    target = some_target()
    posterior = run.infer(
        np.random.default_rng(2), target.prior, target.response, target.comparisons, settings
    )
    assert [chains.points.shape[1] for chains in runs] == [100, 200, 400]
    np.testing.assert_allclose(
        posterior.mean, target.weights(runs[-1].points.reshape(-1, 3)).mean(axis=0), rtol=0, atol=1e-15
    )


def test_a_mode_that_the_mixture_has_missed_shows_in_the_chain_that_is_there():
    """Starts of their own are what lets R-hat see it: chains in two places don't agree."""
    target = Target(Prior("sphere", 2), ResponseModel("sigmoid", 1e3, 0.0), ComparisonSet(*_contradictions()))
    narrow = Mixture(np.ones(1), np.array([[-2.0]]), np.array([[[0.05]]]))
    proposal = Proposal(narrow, np.array([[1e-4]]), np.array([[-2.0], [-2.01], [2.0], [2.01]]))
    draws = run_chains(np.random.default_rng(1), target, proposal, 500).points
    found = diagnose(target.weights(draws.reshape(-1, 1)).reshape(4, 500, 2), 1.0)
    assert found.r_hat.max() > 1.05
    assert not found.has_converged


def _contradictions():
    """Two answers that no weights meet: what is left lies at both ends."""
    return np.array([[1.0, -0.1], [-0.1, 1.0]]), np.array([-1.0, -1.0])


@pytest.mark.statistical
def test_many_answers_find_the_truth():
    case = Case("sphere", rationality=200.0, lapse_rate=0.1)
    comparisons = brute_force.answers(case, 1000)
    target = Target(Prior("sphere", 4), ResponseModel("sigmoid", 200.0, 0.1), comparisons)
    points = chains_of(target, n_draws=1000).points
    mean = target.weights(points.reshape(-1, 3)).mean(axis=0)
    truth = brute_force.TRUTH[:4]
    assert mean @ truth / (np.linalg.norm(mean) * np.linalg.norm(truth)) > 0.995
