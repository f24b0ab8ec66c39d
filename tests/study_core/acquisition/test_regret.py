"""Maximum regret against a double loop over samples."""

import math

import numpy as np

from study_core.acquisition.regret import rank_pairs
from tests.study_core.acquisition.made_up import bank_of, posterior_of, rows_of, situation_of

RNG = np.random.default_rng(3)
SAMPLES = np.abs(RNG.normal(size=(30, 4)))
BANK = bank_of(RNG.normal(size=(12, 4)), np.arange(12.0))


def brute_force(log_densities):
    """Returns the best score of each pair of drives."""
    best, most_likely = {}, max(log_densities)
    drives = [max(range(12), key=lambda row: float(BANK.features[row] @ w)) for w in SAMPLES]
    for i in range(30):
        for j in range(i + 1, 30):
            apart = BANK.features[drives[i]] - BANK.features[drives[j]]
            regret = float(SAMPLES[i] @ apart) - float(SAMPLES[j] @ apart)
            likely = math.exp(log_densities[i] + log_densities[j] - 2.0 * most_likely)
            pair = tuple(sorted((drives[i], drives[j])))
            best[pair] = max(best.get(pair, 0.0), likely * regret)
    return best


def test_the_ranking_is_that_of_a_double_loop():
    logs = -500.0 - np.random.default_rng(4).exponential(2.0, 30)
    ranked = rank_pairs(
        np.random.default_rng(0), situation_of(posterior_of(SAMPLES, log_densities=logs), BANK), 5
    )
    expected = brute_force(logs)
    assert rows_of(BANK, ranked) == sorted(expected, key=lambda pair: -expected[pair])[:5]
    np.testing.assert_allclose(ranked.scores, sorted(expected.values(), reverse=True)[:5], rtol=1e-12)


def test_what_is_shown_is_each_samples_best_drive_and_no_pair_twice():
    posterior = posterior_of(SAMPLES)
    rows = rows_of(BANK, rank_pairs(np.random.default_rng(0), situation_of(posterior, BANK), 50))
    assert len(set(rows)) == len(rows)
    assert {row for pair in rows for row in pair} <= set((SAMPLES @ BANK.features.T).argmax(axis=1).tolist())


def test_unlikely_samples_have_little_say():
    logs = np.full(30, -1000.0)
    drives = (SAMPLES @ BANK.features.T).argmax(axis=1)
    likely = [0, int(np.flatnonzero(drives != drives[0])[0])]
    logs[likely] = -1.0
    ranked = rank_pairs(
        np.random.default_rng(0), situation_of(posterior_of(SAMPLES, log_densities=logs), BANK), 1
    )
    assert rows_of(BANK, ranked) == [tuple(sorted(drives[likely].tolist()))]
