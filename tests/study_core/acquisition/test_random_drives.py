"""The baseline is uniform over pairs of the bank's drives."""

import numpy as np
import pytest
from scipy.stats import chisquare

from study_core.acquisition.random_drives import rank_pairs
from tests.study_core.acquisition.made_up import bank_of, posterior_of, rows_of, situation_of

BANK = bank_of(np.random.default_rng(0).random((6, 4)), np.arange(6.0))


@pytest.mark.statistical
def test_every_pair_comes_first_as_often():
    situation = situation_of(posterior_of(np.eye(4)), BANK)
    counts = np.zeros((6, 6))
    for seed in range(3000):
        counts[rows_of(BANK, rank_pairs(np.random.default_rng(seed), situation, 1))[0]] += 1
    assert chisquare(counts[np.triu_indices(6, k=1)]).pvalue > 1e-4
    assert counts.sum() == counts[np.triu_indices(6, k=1)].sum()


def test_no_pair_comes_twice_and_all_scores_are_equal():
    ranked = rank_pairs(np.random.default_rng(1), situation_of(posterior_of(np.eye(4)), BANK), 15)
    assert len(set(rows_of(BANK, ranked))) == 15
    assert not ranked.scores.any()


def test_what_has_been_answered_has_no_part_in_it():
    first, second = (
        rank_pairs(np.random.default_rng(2), situation_of(posterior_of(samples), BANK), 5)
        for samples in (np.eye(4), np.ones((3, 4)))
    )
    np.testing.assert_array_equal(first.controls, second.controls)
