"""The most informative pair of a bank, against scoring every pair one by one."""

from itertools import combinations

import numpy as np
import pytest

from study_core.acquisition import information_gain_realistic, kernels
from study_core.acquisition.information_gain_realistic import rank_pairs
from tests.study_core.acquisition.made_up import bank_of, rows_of, situation_of, varied_posterior
from tests.study_core.acquisition.test_information_gain import gain


def small_bank(n=16):
    rng = np.random.default_rng(7)
    return bank_of(rng.normal(0.0, 0.05, (n, 4)), 10.0 * np.arange(n))


def every_gain(posterior, bank):
    return {
        (i, j): gain(posterior, bank.features[i] - bank.features[j])
        for i, j in combinations(range(len(bank.features)), 2)
    }


@pytest.mark.parametrize("with_ties", [False, True])
def test_the_best_pair_of_a_small_bank_is_found(with_ties):
    bank, posterior = small_bank(), varied_posterior(50, with_ties)
    gains = every_gain(posterior, bank)
    ranked = rank_pairs(np.random.default_rng(1), situation_of(posterior, bank), 10)
    best = sorted(gains, key=lambda pair: -gains[pair])[:10]
    assert rows_of(bank, ranked)[0] == best[0]
    np.testing.assert_allclose(ranked.scores, [gains[pair] for pair in rows_of(bank, ranked)], rtol=1e-10)


def test_the_drives_come_with_the_weights_that_they_are_best_for():
    bank = small_bank()
    ranked = rank_pairs(np.random.default_rng(1), situation_of(varied_posterior(50, False), bank), 5)
    for controls, weights in zip(ranked.controls.reshape(-1, 10), ranked.weights.reshape(-1, 4), strict=True):
        row = np.flatnonzero((bank.controls == controls).all(axis=1))[0]
        np.testing.assert_array_equal(weights, bank.weights[row])


def test_a_pair_that_looks_alike_is_passed_over_for_the_best_that_does_not():
    bank, posterior = small_bank(), varied_posterior(50, False)
    gains = every_gain(posterior, bank)
    i, j = max(gains, key=lambda pair: gains[pair])
    places = 10.0 * np.arange(16)
    places[j] = places[i] + 0.4
    ranked = rank_pairs(
        np.random.default_rng(1), situation_of(posterior, bank_of(bank.features, places), 0.5), 10
    )
    del gains[i, j]
    assert rows_of(bank, ranked)[0] == max(gains, key=lambda pair: gains[pair])
    assert (i, j) not in rows_of(bank, ranked)


def test_where_all_drives_look_alike_something_is_ranked_still():
    bank = bank_of(small_bank().features, np.zeros(16))
    ranked = rank_pairs(np.random.default_rng(1), situation_of(varied_posterior(50, False), bank, 0.5), 3)
    assert len(ranked) == 3


def test_a_bank_of_two_drives_has_one_pair():
    bank = bank_of(small_bank().features[:2], [0.0, 5.0])
    ranked = rank_pairs(np.random.default_rng(1), situation_of(varied_posterior(50, False), bank), 3)
    assert rows_of(bank, ranked) == [(0, 1)]


@pytest.mark.parametrize("with_ties", [False, True])
def test_screening_keeps_the_pairs_that_matter(with_ties):
    """The estimate is rough, but of the fifty best pairs none is screened out."""
    bank, posterior = small_bank(80), varied_posterior(64, with_ties)
    gains = every_gain(posterior, bank)
    pairs = np.array(list(gains))
    parameters = posterior.parameters
    estimates = kernels.screen(
        bank.features,
        pairs,
        np.ascontiguousarray((posterior.samples * parameters.rationality[:, None]).T),
        parameters.lapse_rate,
        parameters.tie_threshold,
    )
    best = np.argsort(-np.array(list(gains.values())))[:50]
    kept = np.argsort(-estimates)[: information_gain_realistic._N_SCORED]
    assert set(best) <= set(kept)
