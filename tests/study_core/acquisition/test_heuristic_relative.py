"""The relative heuristic against a double loop; what it cures in the paper's."""

import math

import numpy as np
import pytest

from study_core.acquisition import heuristic, heuristic_relative
from tests.study_core.acquisition.made_up import posterior_of, situation_of


def brute_force(samples, logs, mu):
    scored = {}
    for i in range(len(samples)):
        for j in range(i + 1, len(samples)):
            a, b = samples[i] / math.hypot(*samples[i]), samples[j] / math.hypot(*samples[j])
            likely = math.exp(logs[i] - max(logs)) * math.exp(logs[j] - max(logs))
            scored[i, j] = likely + mu * math.dist(a, b)
    return scored


@pytest.mark.parametrize("scale", [0.1, 3.0, 1e5])
def test_the_ranking_is_that_of_a_double_loop(scale):
    rng = np.random.default_rng(4)
    samples, logs = rng.random((20, 4)), -400.0 - scale * rng.exponential(size=20)
    expected = brute_force(samples, logs, 0.1)
    ranked = heuristic_relative.rank_pairs(rng, situation_of(posterior_of(samples, log_densities=logs)), 190)
    order = sorted(expected, key=lambda pair: -expected[pair])
    np.testing.assert_allclose(ranked.scores, [expected[pair] for pair in order], rtol=1e-12)
    np.testing.assert_array_equal(ranked.weights[0], samples[list(order[0])])


def test_after_many_answers_the_likely_samples_still_count():
    samples = np.array([[0.9, 0.1], [0.1, 0.9], [0.7, 0.3], [0.4, 0.6]])
    situation = situation_of(posterior_of(samples, log_densities=[-900.0, -900.0, -800.0, -800.0]))
    relative = heuristic_relative.rank_pairs(np.random.default_rng(0), situation, 1)
    papers = heuristic.rank_pairs(np.random.default_rng(0), situation, 1)
    np.testing.assert_array_equal(relative.weights[0], samples[[2, 3]])
    np.testing.assert_array_equal(papers.weights[0], samples[[0, 1]])


def test_the_length_of_the_weights_has_no_part_in_it():
    samples = np.random.default_rng(5).random((10, 4)) + 0.1
    lengths = np.random.default_rng(6).uniform(0.1, 5.0, (10, 1))
    first, second = (
        heuristic_relative.rank_pairs(np.random.default_rng(0), situation_of(posterior_of(rows)), 45)
        for rows in (samples, samples * lengths)
    )
    np.testing.assert_allclose(first.scores, second.scores, rtol=1e-12)
