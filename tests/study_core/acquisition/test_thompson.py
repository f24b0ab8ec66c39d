"""Thompson sampling is uniform over pairs of samples."""

import numpy as np
import pytest
from scipy.stats import chisquare

from study_core.acquisition.pairs import Situation
from study_core.acquisition.thompson import rank_pairs
from study_core.choice import ResponseParameters
from study_core.domains.driving import DRIVING_V1
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior

NONE = Diagnostics(np.ones(2), np.ones(2), np.ones(2), 0.3, 4000)


def situation_of(n, mu=0.1):
    samples = np.random.default_rng(n).random((n, 2))
    parameters = ResponseParameters.constant(n, 50.0)
    posterior = Posterior(samples, parameters, -np.arange(float(n)), samples.mean(axis=0), NONE)
    return Situation(DRIVING_V1, posterior, None, mu, 0.0)


@pytest.mark.statistical
def test_every_pair_comes_first_as_often():
    situation = situation_of(6)
    rows = {row.tobytes(): index for index, row in enumerate(situation.posterior.samples)}
    counts = np.zeros((6, 6))
    for seed in range(3000):
        first, second = rank_pairs(np.random.default_rng(seed), situation, 1).weights[0]
        counts[rows[first.tobytes()], rows[second.tobytes()]] += 1
    assert chisquare(counts[np.triu_indices(6, k=1)]).pvalue > 1e-4


def test_no_pair_comes_twice_and_all_scores_are_equal():
    ranked = rank_pairs(np.random.default_rng(1), situation_of(6), 15)
    assert len({pair.tobytes() for pair in ranked.weights}) == 15
    assert not ranked.scores.any()


def test_mu_has_no_part_in_it():
    first, second = (rank_pairs(np.random.default_rng(2), situation_of(9, mu), 5) for mu in (0.0, 7.0))
    np.testing.assert_array_equal(first.weights, second.weights)
