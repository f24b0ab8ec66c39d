"""Diagnostics against arviz, the field's own implementation."""

import arviz
import numpy as np
import pytest

from study_core.posterior.diagnostics import LARGEST_R_HAT, SMALLEST_ESS, Diagnostics, diagnose


def autoregression(rng, n_chains, n_draws, correlation):
    noise = rng.standard_normal((n_chains, n_draws))
    draws = np.empty_like(noise)
    draws[:, 0] = noise[:, 0] / np.sqrt(1 - correlation**2)
    for t in range(1, n_draws):
        draws[:, t] = correlation * draws[:, t - 1] + noise[:, t]
    return draws


def repeated_like_metropolis(rng, n_chains, n_draws):
    """Draws that stay where they are two times out of three: many ties."""
    draws = rng.standard_normal((n_chains, n_draws))
    for t in range(1, n_draws):
        stays = rng.random(n_chains) < 0.67
        draws[stays, t] = draws[stays, t - 1]
    return draws


def a_random_walk(rng, n_chains, n_draws):
    return rng.standard_normal((n_chains, n_draws)).cumsum(axis=1)


def one_chain_elsewhere(rng, n_chains, n_draws):
    return rng.standard_normal((n_chains, n_draws)) + 3.0 * (np.arange(n_chains) == 0)[:, None]


def one_chain_wider(rng, n_chains, n_draws):
    return rng.standard_normal((n_chains, n_draws)) * np.where(np.arange(n_chains) == 0, 5.0, 1.0)[:, None]


CASES = {
    "independent": lambda rng, c, n: rng.standard_normal((c, n)),
    "correlated": lambda rng, c, n: autoregression(rng, c, n, 0.9),
    "nearly stuck": lambda rng, c, n: autoregression(rng, c, n, 0.998),
    "alternating": lambda rng, c, n: autoregression(rng, c, n, -0.7),
    "strongly alternating": lambda rng, c, n: autoregression(rng, c, n, -0.99),
    "heavy tails": lambda rng, c, n: rng.standard_cauchy((c, n)),
    "few values, many ties": lambda rng, c, n: rng.binomial(8, 0.5, (c, n)).astype(float),
    "ties on both sides of the median": lambda rng, c, n: rng.binomial(20, 0.5, (c, n)) - 10.0,
    "repeated": repeated_like_metropolis,
    "random walk": a_random_walk,
    "one chain elsewhere": one_chain_elsewhere,
    "one chain wider": one_chain_wider,
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("n_chains", "n_draws"), [(4, 1000), (2, 101), (4, 100), (16, 333)])
def test_every_number_is_what_arviz_says(case, n_chains, n_draws):
    rng = np.random.default_rng([n_chains, n_draws, len(case)])
    draws = CASES[case](rng, n_chains, n_draws)
    found = diagnose(draws[:, :, None], acceptance=0.3)
    assert found.r_hat[0] == pytest.approx(float(arviz.rhat(draws, method="rank")), rel=1e-9)
    assert found.ess_bulk[0] == pytest.approx(float(arviz.ess(draws, method="bulk")), rel=1e-9)
    assert found.ess_tail[0] == pytest.approx(float(arviz.ess(draws, method="tail")), rel=1e-9)


def test_every_weight_has_its_own_numbers():
    rng = np.random.default_rng(8)
    draws = np.stack([autoregression(rng, 4, 500, rho) for rho in (0.0, 0.5, 0.95)], axis=-1)
    together = diagnose(draws, 0.3)
    for k in range(3):
        alone = diagnose(draws[:, :, k : k + 1], 0.3)
        assert (together.r_hat[k], together.ess_bulk[k], together.ess_tail[k]) == (
            alone.r_hat[0],
            alone.ess_bulk[0],
            alone.ess_tail[0],
        )
    assert together.ess_bulk[0] > together.ess_bulk[1] > together.ess_bulk[2]
    assert together.acceptance == 0.3


def test_a_tail_that_is_one_tied_value_counts_as_nothing():
    draws = np.random.default_rng(10).standard_normal((4, 500, 1)).clip(max=1.0)
    found = diagnose(draws, acceptance=0.3)
    assert found.ess_tail[0] == 0.0
    assert found.ess_bulk[0] > 500
    assert not found.has_converged


def test_two_values_at_equal_distance_from_the_median_are_not_a_nan():
    draws = np.tile([-1.0, 1.0], 250)[None, :, None] * np.array([1, -1, 1, -1])[:, None, None]
    found = diagnose(draws, acceptance=0.3)
    assert np.isfinite([found.r_hat[0], found.ess_bulk[0], found.ess_tail[0]]).all()


def test_draws_that_never_move_are_reported_as_such():
    found = diagnose(np.full((4, 500, 1), 0.25), acceptance=0.0)
    assert (found.r_hat[0], found.ess_bulk[0], found.ess_tail[0]) == (np.inf, 0.0, 0.0)
    assert not found.has_converged


def test_chains_stuck_at_different_places_are_reported_as_such():
    draws = np.repeat(np.arange(4.0)[:, None, None], 500, axis=1)
    found = diagnose(draws, acceptance=0.0)
    assert (found.r_hat[0], found.ess_bulk[0], found.ess_tail[0]) == (np.inf, 0.0, 0.0)
    assert not found.has_converged


def test_one_stuck_chain_among_moving_ones_is_not_converged():
    draws = np.random.default_rng(9).standard_normal((4, 2000, 1))
    draws[2] = 2.5
    found = diagnose(draws, acceptance=0.3)
    assert np.isfinite([found.r_hat[0], found.ess_bulk[0], found.ess_tail[0]]).all()
    assert found.r_hat[0] > 1.05
    assert not found.has_converged


@pytest.mark.parametrize(
    ("r_hat", "ess_bulk", "ess_tail", "has_converged"),
    [
        (LARGEST_R_HAT, SMALLEST_ESS, SMALLEST_ESS, True),
        (LARGEST_R_HAT + 1e-6, 1e4, 1e4, False),
        (1.0, SMALLEST_ESS - 1e-6, 1e4, False),
        (1.0, 1e4, SMALLEST_ESS - 1e-6, False),
        (np.nan, 1e4, 1e4, False),
        (1.0, np.nan, 1e4, False),
        (1.0, 1e4, np.nan, False),
    ],
)
def test_convergence_needs_every_number_of_every_weight(r_hat, ess_bulk, ess_tail, has_converged):
    found = Diagnostics(
        np.array([1.0, r_hat]), np.array([1e4, ess_bulk]), np.array([1e4, ess_tail]), 0.3, 40_000
    )
    assert found.has_converged is has_converged


def test_the_thresholds_are_those_that_are_promised():
    assert (LARGEST_R_HAT, SMALLEST_ESS) == (1.01, 1000.0)


def test_what_has_not_converged_says_so_in_numbers():
    found = Diagnostics(np.array([1.0, 1.0234]), np.array([870.4, 1e4]), np.array([1e4, 1e4]), 0.3, 48_000)
    assert found.warning == (
        "After 48000 draws R-hat is 1.023 and the effective sample size 870; expected at most 1.01 and at least 1000."
    )
    assert Diagnostics(np.ones(2), np.full(2, 2e3), np.full(2, 2e3), 0.3, 4000).warning is None


def test_the_draws_of_all_chains_are_counted():
    assert diagnose(np.random.default_rng(1).standard_normal((4, 250, 2)), 0.3).n_draws == 1000
