"""The rebuilt APReL does the work that it stands for: the right posterior, the most informative pair."""

import numpy as np
import pytest

from app.bench import aprel
from tests.study_core import references

BETA, LAPSE = 40.0, 0.1


@pytest.fixture(scope="module")
def slates():
    """Thirty pairs, the better one first."""
    pairs = np.random.default_rng(21).normal(0.0, 0.07, (30, 2, 4))
    is_better = pairs @ np.array([0.6, 0.1, 0.7, 0.35])
    return np.where((is_better[:, 0] > is_better[:, 1])[:, None, None], pairs, pairs[:, ::-1])


def reference_log_likelihoods(weights, slates):
    utilities = weights @ (slates[:, 0] - slates[:, 1]).T
    terms = references.log_answer_probability("sigmoid", BETA, LAPSE, utilities)
    return terms.sum(axis=1)


@pytest.mark.parametrize("likelihood_of", [aprel.looped_log_likelihood, aprel.vectorised_log_likelihood])
def test_both_ways_have_the_likelihood_of_the_sigmoid_with_lapses(likelihood_of, slates):
    weights = references.prior_draws(np.random.default_rng(22), "sphere", 20)
    likelihood = likelihood_of(slates, BETA, LAPSE)
    values = [likelihood(row) for row in weights]
    np.testing.assert_allclose(values, reference_log_likelihoods(weights, slates), rtol=1e-12)


@pytest.mark.statistical
def test_the_belief_is_the_posterior(slates):
    points = references.prior_draws(np.random.default_rng(23), "sphere", 200_000)
    importance = np.exp(reference_log_likelihoods(points, slates))
    mean = importance @ points / importance.sum()
    likelihood = aprel.vectorised_log_likelihood(slates, BETA, LAPSE)
    chains = [aprel.sample_belief(np.random.default_rng(seed), 4, likelihood) for seed in range(12)]
    assert chains[0].shape == (100, 4)
    assert min(chain.min() for chain in chains) >= 0.0
    means = np.array([chain.mean(axis=0) for chain in chains])
    error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    assert (np.abs(means.mean(axis=0) - mean) < 4.5 * error).all()


def test_both_ways_find_the_pair_with_the_largest_mutual_information():
    rng = np.random.default_rng(24)
    features, samples = rng.normal(0.0, 0.2, (9, 4)), references.prior_draws(rng, "sphere", 25)
    rewards = samples @ features.T
    likely_a = 0.05 + 0.9 / (1.0 + np.exp(-BETA * (rewards[:, :, None] - rewards[:, None, :])))
    # H(answer) - E H(answer | w), where the product sums logarithms of ratios.
    gains = np.triu(entropy(likely_a.mean(axis=0)) - entropy(likely_a).mean(axis=0), k=1)
    expected = np.unravel_index(gains.argmax(), gains.shape)
    assert aprel.looped_best_pair(features, samples, BETA, LAPSE) == expected
    assert aprel.vectorised_best_pair(features, samples, BETA, LAPSE) == expected


def entropy(likely):
    return -(likely * np.log2(likely) + (1.0 - likely) * np.log2(1.0 - likely))
