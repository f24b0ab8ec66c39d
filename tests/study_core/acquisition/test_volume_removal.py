"""Volume removal against its definition summed sample by sample."""

import math

import numpy as np

from study_core.acquisition.volume_removal import rank_pairs, removed_volumes
from tests.study_core import references
from tests.study_core.acquisition.made_up import posterior_of, situation_of, varied_posterior


def removed(posterior, psi):
    """Returns the share removed by A and by B."""
    kept = [
        (min(1.0, math.exp(beta * float(w @ psi))), min(1.0, math.exp(-beta * float(w @ psi))))
        for w, beta in zip(posterior.samples, posterior.parameters.rationality, strict=True)
    ]
    return [1.0 - math.fsum(column) / len(kept) for column in zip(*kept, strict=True)]


def test_an_answer_removes_what_would_not_have_given_it():
    posterior = varied_posterior(31, False)
    psis = np.random.default_rng(1).normal(0.0, 0.05, (9, 4))
    volumes, _ = removed_volumes(posterior, psis)
    np.testing.assert_allclose(volumes.T, [removed(posterior, psi) for psi in psis], rtol=1e-12, atol=1e-15)


def test_its_slopes_are_what_a_small_step_changes():
    posterior = varied_posterior(31, False)
    psis = np.random.default_rng(2).normal(0.0, 0.02, (5, 4))
    _, slopes = removed_volumes(posterior, psis)
    for n, psi in enumerate(psis):
        for k, step in enumerate(1e-7 * np.eye(4)):
            change = np.subtract(removed(posterior, psi + step), removed(posterior, psi - step)) / 2e-7
            np.testing.assert_allclose(slopes[:, n, k], change, rtol=1e-5, atol=1e-6)


def test_equal_drives_remove_nothing():
    """What makes min(m, 1 - m) ill-posed: there, equal drives are the best of all."""
    volumes, _ = removed_volumes(varied_posterior(31, False), np.zeros((1, 4)))
    np.testing.assert_array_equal(volumes, 0.0)


def test_samples_that_are_certain_of_opposite_answers_lose_half_either_way():
    volumes, _ = removed_volumes(posterior_of(np.eye(2), 1e5), np.array([[1.0, -1.0]]))
    np.testing.assert_allclose(volumes, 0.5, rtol=1e-12)


def test_pairs_are_ranked_by_what_the_worse_answer_removes():
    posterior = varied_posterior(40, False)
    ranked = rank_pairs(np.random.default_rng(5), situation_of(posterior), 10)
    psis = [
        np.subtract(*(references.features(references.drive(references.ROBOT_START, c)) for c in pair))
        for pair in ranked.controls
    ]
    np.testing.assert_allclose(ranked.scores, [min(removed(posterior, psi)) for psi in psis], rtol=1e-5)
    assert 0.35 < ranked.scores[0] <= 0.5
