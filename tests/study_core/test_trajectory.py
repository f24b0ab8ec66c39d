"""The optimiser against known optima, scipy, and what it must never do."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from study_core import lbfgs
from study_core.bank import Bank, build_bank
from study_core.distinctness import visible_difference
from study_core.domains.driving import DRIVING_V1
from study_core.errors import BankError
from study_core.lbfgs import maximise
from study_core.trajectory import best_from_bank, best_trajectories
from tests.study_core import references
from tests.study_core.hills import HillsDomain

# The best reward known for these weights, and what the median of single random starts reaches.
HARD_WEIGHTS = np.array([[0.36, 0.2, 0.39, 0.25]])
HARD_BEST, HARD_MEDIAN = 0.6695, 0.611

WEIGHTS = references.prior_draws(np.random.default_rng(41), "sphere", 5)


def rewards_of(controls, weights):
    """w . Phi by the naive loop."""
    return np.array(
        [
            np.dot(w, references.features(references.drive(references.ROBOT_START, row)))
            for row, w in zip(controls, weights, strict=True)
        ]
    )


def projected_gradients(controls, weights):
    """How far a unit gradient step moves within the bounds: zero at a local optimum."""
    _, gradients = DRIVING_V1.reward_and_gradient(controls, weights)
    return np.abs(np.clip(controls + gradients, -1.0, 1.0) - controls).max(axis=1)


def test_all_starts_differ_and_fill_the_bounds():
    spy = references.FirstEvaluation(DRIVING_V1)
    best_trajectories(np.random.default_rng(1), spy, WEIGHTS, 10)
    assert spy.starts.shape == (50, 10)
    assert len(np.unique(spy.starts, axis=0)) == 50
    assert (np.abs(spy.starts) <= 1.0).all()
    # 500 uniform numbers: mean within 4.5 standard errors of 0, both ends reached.
    assert abs(spy.starts.mean()) < 4.5 / math.sqrt(3 * 500)
    assert spy.starts.min() < -0.95
    assert spy.starts.max() > 0.95


def test_starts_fill_bounds_that_are_not_minus_one_to_one():
    domain = references.QuadraticDomain([[0.0, 6.0]], [1.0, 1.0])
    domain.control_lower, domain.control_upper = np.array([-3.0, 5.0]), np.array([-1.0, 9.0])
    spy = references.FirstEvaluation(domain)
    best = best_trajectories(np.random.default_rng(1), spy, np.ones((1, 1)), 200)
    assert (spy.starts >= domain.control_lower).all()
    assert (spy.starts <= domain.control_upper).all()
    assert np.ptp(spy.starts, axis=0) == pytest.approx([2.0, 4.0], rel=0.05)
    np.testing.assert_allclose(best.controls, [[-1.0, 6.0]], rtol=0, atol=1e-6)


def test_the_result_is_never_worse_than_any_of_its_starts():
    rng = np.random.default_rng(2)
    starts, weights = rng.uniform(-1, 1, (200, 10)), references.prior_draws(rng, "ball", 200)
    controls, rewards, _, _ = maximise(DRIVING_V1, starts, weights)
    assert (rewards >= rewards_of(starts, weights) - 1e-12).all()
    assert (np.abs(controls) <= 1.0).all()


def test_the_best_of_all_starts_wins_for_each_weight_vector():
    rng_seed, n_starts = 3, 8
    spy = references.FirstEvaluation(DRIVING_V1)
    best = best_trajectories(np.random.default_rng(rng_seed), spy, WEIGHTS, n_starts)
    for k, weights in enumerate(WEIGHTS):
        own = spy.starts[k * n_starts : (k + 1) * n_starts]
        _, rewards, _, _ = maximise(DRIVING_V1, own, np.tile(weights, (n_starts, 1)))
        assert best.rewards[k] == pytest.approx(rewards.max(), abs=1e-9)
        assert np.ptp(rewards) > 1e-6, "all starts found one optimum: nothing was compared"


def test_rewards_belong_to_the_controls():
    best = best_trajectories(np.random.default_rng(4), DRIVING_V1, WEIGHTS, 5)
    np.testing.assert_allclose(best.rewards, rewards_of(best.controls, WEIGHTS), rtol=0, atol=1e-12)
    assert (np.abs(best.controls) <= 1.0).all()


def test_what_is_called_converged_has_no_projected_gradient():
    rng = np.random.default_rng(5)
    starts, weights = rng.uniform(-1, 1, (300, 10)), references.prior_draws(rng, "sphere", 300)
    controls, _, has_converged, n_evaluations = maximise(DRIVING_V1, starts, weights)
    assert has_converged.mean() > 0.98
    assert projected_gradients(controls, weights)[has_converged].max() < 1e-5
    assert projected_gradients(starts, weights).min() > 1e-3, "the starts were optimal already"
    assert n_evaluations <= 300


def test_running_out_of_evaluations_is_reported_and_still_no_worse(monkeypatch):
    monkeypatch.setattr(lbfgs, "_MAX_EVALUATIONS", 3)
    rng = np.random.default_rng(6)
    starts, weights = rng.uniform(-1, 1, (20, 10)), references.prior_draws(rng, "sphere", 20)
    _, rewards, has_converged, n_evaluations = maximise(DRIVING_V1, starts, weights)
    assert n_evaluations == 3
    assert not has_converged.any()
    assert (rewards >= rewards_of(starts, weights) - 1e-12).all()


@pytest.mark.parametrize(
    ("targets", "weights"),
    [
        ([[0.3, -0.5, 0.0, 0.9]], [1.0]),
        ([[1.7, -0.5, 0.2, -3.0]], [1.0]),
        ([[2.0, 0.0, 0.1, 0.2], [-1.0, 0.4, 5.0, 0.3]], [0.3, 0.7]),
        ([[4.0, -4.0, 4.0, -4.0]], [1.0]),
    ],
    ids=["interior", "two at a bound", "between two targets", "a corner"],
)
def test_a_quadratic_is_solved_in_the_interior_and_at_its_bounds(targets, weights):
    domain = references.QuadraticDomain(targets, [1.0, 30.0, 0.1, 5.0])
    best = best_trajectories(np.random.default_rng(7), domain, np.array([weights]), 4)
    np.testing.assert_allclose(best.controls[0], domain.best_controls(np.array(weights)), rtol=0, atol=1e-5)
    assert best.has_converged.all()


@given(seed=st.integers(0, 10**6))
def test_any_quadratic_ends_at_its_known_optimum_from_any_start(seed):
    rng = np.random.default_rng(seed)
    domain = references.QuadraticDomain(rng.normal(0, 1.2, (3, 5)), 10.0 ** rng.uniform(-1, 2, 5))
    weights = rng.random((6, 3)) + 0.05
    controls, _, has_converged, _ = maximise(domain, rng.uniform(-1, 1, (6, 5)), weights)
    expected = [domain.best_controls(row) for row in weights]
    np.testing.assert_allclose(controls, expected, rtol=0, atol=1e-4)
    assert has_converged.all()


def test_a_start_that_is_the_optimum_stays_there():
    domain = references.QuadraticDomain([[0.5, 3.0]], [1.0, 1.0])
    optimum = np.array([[0.5, 1.0]])
    controls, _, has_converged, n_evaluations = maximise(domain, optimum, np.ones((1, 1)))
    np.testing.assert_array_equal(controls, optimum)
    assert has_converged.all()
    assert n_evaluations == 1


def test_starts_outside_the_bounds_are_brought_inside():
    controls, _, _, _ = maximise(DRIVING_V1, np.full((1, 10), 7.0), WEIGHTS[:1])
    assert (np.abs(controls) <= 1.0).all()


def by_scipy(start, weights):
    def minus_reward(row):
        rewards, gradients = DRIVING_V1.reward_and_gradient(row[None], weights[None])
        return -rewards[0], -gradients[0]

    tight = {"ftol": 1e-14, "gtol": 1e-9, "maxiter": 500}
    found = minimize(minus_reward, start, jac=True, method="L-BFGS-B", bounds=[(-1, 1)] * 10, options=tight)
    return -found.fun


def test_scipy_finds_nothing_better_than_the_best_of_many_starts():
    for weights in WEIGHTS:
        starts = np.random.default_rng(8).uniform(-1, 1, (600, 10))
        controls, rewards, _, _ = maximise(DRIVING_V1, starts, np.tile(weights, (600, 1)))
        theirs = np.array([by_scipy(start, weights) for start in starts[:60]])
        assert rewards.max() >= theirs.max() - 1e-7
        assert by_scipy(controls[rewards.argmax()], weights) == pytest.approx(rewards.max(), abs=1e-7)
        # Start by start the two may climb different hills; on the whole neither climbs higher.
        assert np.median(rewards[:60]) == pytest.approx(np.median(theirs), abs=0.02)


def test_a_thousand_starts_reach_the_best_reward_known_for_a_hard_case():
    best = best_trajectories(np.random.default_rng(9), DRIVING_V1, HARD_WEIGHTS, 1000)
    assert best.rewards[0] == pytest.approx(HARD_BEST, abs=5e-5)
    assert best.has_converged.all()


def test_single_starts_end_where_they_were_measured_to_end():
    rng = np.random.default_rng(10)
    _, rewards, _, _ = maximise(
        DRIVING_V1, rng.uniform(-1, 1, (1000, 10)), np.repeat(HARD_WEIGHTS, 1000, axis=0)
    )
    assert np.median(rewards) == pytest.approx(HARD_MEDIAN, abs=0.01)
    assert rewards.max() < HARD_BEST + 1e-4
    # About one start in 70 reaches the best.
    assert 4 <= (rewards > HARD_BEST - 2e-4).sum() <= 40


def test_the_same_stream_gives_the_same_bits():
    first, second = (best_trajectories(np.random.default_rng(11), DRIVING_V1, WEIGHTS, 6) for _ in range(2))
    np.testing.assert_array_equal(first.controls, second.controls)
    np.testing.assert_array_equal(first.rewards, second.rewards)
    assert first.n_evaluations == second.n_evaluations


def test_a_row_of_the_batch_does_not_see_its_neighbours():
    rng = np.random.default_rng(12)
    starts, weights = rng.uniform(-1, 1, (12, 10)), references.prior_draws(rng, "sphere", 12)
    together, _, _, _ = maximise(DRIVING_V1, starts, weights)
    for k in range(12):
        alone, _, _, _ = maximise(DRIVING_V1, starts[k : k + 1], weights[k : k + 1])
        np.testing.assert_array_equal(alone[0], together[k])


def test_starts_and_weights_are_left_as_they_were():
    rng = np.random.default_rng(13)
    starts, weights = rng.uniform(-1, 1, (4, 10)), references.prior_draws(rng, "sphere", 4)
    kept = starts.copy(), weights.copy()
    maximise(DRIVING_V1, starts, weights)
    np.testing.assert_array_equal(starts, kept[0])
    np.testing.assert_array_equal(weights, kept[1])


@pytest.fixture(scope="module")
def driving_bank():
    return build_bank(DRIVING_V1)


def test_the_bank_finds_the_highest_of_known_hills():
    domain = HillsDomain()
    bank = build_bank(domain, 100)
    weights = references.prior_draws(np.random.default_rng(21), "sphere", 200)[:, :3]
    axis = np.linspace(-1, 1, 401)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    highest = (weights @ domain.features(grid[:, None, :]).T).max(axis=1)
    best = best_from_bank(domain, bank, weights)
    # The grid misses a top by at most a quarter of a cell's diagonal.
    assert (best.rewards >= highest - 1e-12).all()
    assert (best.rewards <= highest + 1e-3).all()
    assert best.has_converged.all()


def test_from_the_bank_the_result_is_at_least_as_good_as_every_drive_of_it(driving_bank):
    weights = references.prior_draws(np.random.default_rng(22), "ball", 50)
    best = best_from_bank(DRIVING_V1, driving_bank, weights)
    assert (best.rewards >= (weights @ driving_bank.features.T).max(axis=1) - 1e-12).all()
    np.testing.assert_allclose(best.rewards, rewards_of(best.controls, weights), rtol=0, atol=1e-12)
    assert (np.abs(best.controls) <= 1.0).all()
    assert best.has_converged.all()


def test_from_the_bank_a_row_of_the_batch_does_not_see_its_neighbours(driving_bank):
    weights = references.prior_draws(np.random.default_rng(23), "sphere", 8)
    together = best_from_bank(DRIVING_V1, driving_bank, weights)
    for k in range(8):
        alone = best_from_bank(DRIVING_V1, driving_bank, weights[k : k + 1])
        np.testing.assert_array_equal(alone.controls[0], together.controls[k])
        assert alone.rewards[0] == together.rewards[k]


def test_warm_starts_are_the_best_drives_of_the_bank_that_look_different(driving_bank):
    weights = references.prior_draws(np.random.default_rng(24), "sphere", 6)
    spy = references.FirstEvaluation(DRIVING_V1)
    best_from_bank(spy, driving_bank, weights)
    for own, starts in zip(weights, spy.starts.reshape(6, 3, 10), strict=True):
        expected = []
        for row in np.argsort(-(driving_bank.features @ own)):
            paths = driving_bank.paths[[row] * len(expected)]
            if (visible_difference(paths, driving_bank.paths[expected]) > 0.25).all():
                expected.append(row)
            if len(expected) == 3:
                break
        np.testing.assert_array_equal(starts, driving_bank.controls[expected])


def test_a_bank_of_one_drive_is_enough(driving_bank):
    one = Bank(
        "driving-v1",
        "",
        driving_bank.controls[:1],
        driving_bank.features[:1],
        driving_bank.weights[:1],
        driving_bank.paths[:1],
    )
    best = best_from_bank(DRIVING_V1, one, one.weights)
    assert best.rewards[0] == pytest.approx(float(one.features[0] @ one.weights[0]), abs=1e-9)


def test_a_bank_of_another_domain_is_refused():
    bank = build_bank(HillsDomain(), 20)
    with pytest.raises(BankError, match=r"Expected a bank of 'driving-v1', got one of 'hills-v1'\. Open it"):
        best_from_bank(DRIVING_V1, bank, WEIGHTS)


def test_from_the_bank_the_hard_case_is_as_good_as_a_thousand_starts(driving_bank):
    best = best_from_bank(DRIVING_V1, driving_bank, HARD_WEIGHTS)
    assert best.rewards[0] == pytest.approx(HARD_BEST, abs=5e-5)


@pytest.mark.slow
def test_the_bank_does_what_a_thousand_starts_of_scipy_do(driving_bank):
    """SciPy climbs on its own; for 6 weight vectors, 6,000 climbs."""
    for number, weights in enumerate(references.prior_draws(np.random.default_rng(25), "sphere", 6)):
        starts = np.random.default_rng([26, number]).uniform(-1, 1, (1000, 10))
        theirs = max(by_scipy(start, weights) for start in starts)
        (ours,) = best_from_bank(DRIVING_V1, driving_bank, weights[None]).rewards
        rewards = driving_bank.features @ weights
        assert ours >= theirs - 1e-3 * np.ptp(rewards)
