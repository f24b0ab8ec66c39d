"""The baseline is uniform over pairs."""

import numpy as np
import pytest
from scipy.stats import chisquare

from study_core.acquisition.random_pair import rank_pairs
from study_core.choice import ResponseParameters
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior

NONE = Diagnostics(np.ones(2), np.ones(2), np.ones(2), 0.3, 4000)


def posterior_of(n):
    samples = np.random.default_rng(n).random((n, 2))
    return Posterior(
        samples, ResponseParameters.constant(n, 50.0), -np.arange(float(n)), samples.mean(axis=0), NONE
    )


@pytest.mark.statistical
def test_every_pair_comes_first_as_often():
    counts = np.zeros((6, 6))
    for seed in range(3000):
        i, j = rank_pairs(np.random.default_rng(seed), posterior_of(6), 0.1, 1).indices[0]
        counts[i, j] += 1
    assert chisquare(counts[np.triu_indices(6, k=1)]).pvalue > 1e-4


def test_no_pair_comes_twice_and_all_scores_are_equal():
    ranked = rank_pairs(np.random.default_rng(1), posterior_of(6), 0.1, 15)
    assert len({tuple(pair) for pair in ranked.indices}) == 15
    assert not ranked.scores.any()


def test_mu_has_no_part_in_it():
    first, second = (rank_pairs(np.random.default_rng(2), posterior_of(9), mu, 5) for mu in (0.0, 7.0))
    np.testing.assert_array_equal(first.indices, second.indices)
