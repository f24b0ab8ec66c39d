"""The heuristic against a double loop in fifty-digit decimals."""

from decimal import Decimal, localcontext

import numpy as np
import pytest

from study_core.acquisition import heuristic
from study_core.acquisition.pairs import Situation
from study_core.choice import ResponseParameters
from study_core.domains.driving import DRIVING_V1
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior

NONE = Diagnostics(np.ones(4), np.ones(4), np.ones(4), 0.3, 4000)


def posterior_of(samples, log_densities):
    return Posterior(
        samples, ResponseParameters.constant(len(samples), 50.0), log_densities, samples.mean(axis=0), NONE
    )


def rank_pairs(rng, posterior, mu, n_pairs):
    return heuristic.rank_pairs(rng, Situation(DRIVING_V1, posterior, None, mu, 0.0), n_pairs)


def rows_of(samples, ranked):
    """Which rows of the samples each ranked pair is made of; of equal rows, any."""
    return [
        tuple(int(np.flatnonzero((samples == w).all(axis=1))[0]) for w in pair) for pair in ranked.weights
    ]


def brute_force(samples, log_densities, mu):
    """Every pair with its exact score, best first."""
    with localcontext() as context:
        context.prec = 50
        densities = [Decimal(float(value)).exp() for value in log_densities]
        rows = [[Decimal(float(value)) for value in row] for row in samples]
        scored = []
        for i in range(len(rows)):
            for j in range(i + 1, len(rows)):
                apart = sum(((a - b) ** 2 for a, b in zip(rows[i], rows[j], strict=True)), Decimal(0)).sqrt()
                scored.append((densities[i] * densities[j] + Decimal(mu) * apart, (i, j)))
    return sorted(scored, key=lambda pair: -pair[0])


CASES = {
    "no answers": lambda rng: np.zeros(25),
    "a few answers": lambda rng: -rng.exponential(2.0, 25),
    "many answers": lambda rng: -60.0 - rng.exponential(3.0, 25),
    "likelihoods that underflow": lambda rng: -(10.0 ** rng.uniform(2, 5, 25)),
    "one likely sample": lambda rng: np.where(np.arange(25) < 2, -0.01, -30.0),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mu", [0.01, 0.1, 2.0])
def test_the_ranking_is_what_exact_arithmetic_gives(case, mu):
    rng = np.random.default_rng(len(case))
    samples, log_densities = np.abs(rng.normal(0, 0.5, (25, 4))), CASES[case](rng)
    expected = brute_force(samples, log_densities, mu)
    ranked = rank_pairs(rng, posterior_of(samples, log_densities), mu, 300)
    assert rows_of(samples, ranked) == [pair for _, pair in expected]
    np.testing.assert_allclose(ranked.scores, [float(score) for score, _ in expected], rtol=1e-13)


def test_before_the_first_answer_the_two_samples_farthest_apart_are_asked_about():
    samples = np.array([[0.1, 0.1], [0.9, 0.1], [0.2, 0.3], [0.1, 0.8]])
    ranked = rank_pairs(np.random.default_rng(0), posterior_of(samples, np.zeros(4)), 0.1, 1)
    assert rows_of(samples, ranked) == [(1, 3)]
    assert ranked.scores[0] == pytest.approx(1.0 + 0.1 * (0.8**2 + 0.7**2) ** 0.5, abs=1e-15)


def test_likely_samples_are_preferred_to_unlikely_ones():
    """What the published code got wrong: the product of two log-likelihoods is largest for the unlikely."""
    samples = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.01], [0.01, 1.0]])
    log_densities = np.array([-0.1, -0.1, -5.0, -5.0])
    ranked = rank_pairs(np.random.default_rng(0), posterior_of(samples, log_densities), 0.1, 6)
    assert rows_of(samples, ranked)[0] == (0, 1)


def test_without_a_weight_for_distance_the_two_likeliest_samples_win():
    samples = np.random.default_rng(3).random((10, 4))
    log_densities = -np.arange(10.0)[::-1]
    ranked = rank_pairs(np.random.default_rng(0), posterior_of(samples, log_densities), 0.0, 1)
    assert rows_of(samples, ranked) == [(8, 9)]


def test_equal_scores_keep_the_order_of_the_samples():
    samples = np.eye(4)
    ranked = rank_pairs(np.random.default_rng(0), posterior_of(samples, np.zeros(4)), 0.1, 6)
    assert rows_of(samples, ranked) == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
