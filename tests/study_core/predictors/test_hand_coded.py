"""The hand-coded predictors against their formulas, the paper's bars and a posterior by brute force."""

import numpy as np
import pytest
from scipy.special import expit

from study_core.domains.driving import DRIVING_V1
from study_core.predictors.hand_coded import HandCodedCalibrated, HandCodedStored
from study_core.predictors.predictor import Pairs, Training
from tests.study_core import references
from tests.study_core.networks.people import keeps_left, pairs
from tests.study_core.test_published import PAPERS_ACCURACY

NEW = pairs(3, 12)


def diffs_of(compared):
    return np.array(
        [
            np.subtract(references.features(a), references.features(b))
            for a, b in zip(compared.states_a, compared.states_b, strict=True)
        ]
    )


def test_the_stored_mean_answers_by_the_sigmoid_of_rationality_1():
    training = keeps_left(1, 20)
    model = HandCodedStored().fit(0, DRIVING_V1, {"ann": training}).people["ann"]
    expected = expit(diffs_of(NEW) @ training.stored_mean)
    np.testing.assert_allclose(model.probability_of_a(NEW), expected, rtol=0, atol=1e-12)


@pytest.mark.statistical
def test_where_no_mean_is_stored_it_is_that_of_the_studys_own_posterior():
    """min(I w . psi, 0) over the ball, averaged over fifty thousand points of the prior."""
    training = keeps_left(2, 60, stored_mean=None)
    rng = np.random.default_rng(1)
    points = np.abs(rng.normal(size=(50_000, 4)))
    points *= (rng.random((50_000, 1)) ** 0.25) / np.linalg.norm(points, axis=1, keepdims=True)
    preferred = diffs_of(training.pairs) * training.signs[:, None]
    mass = np.exp(np.minimum(points @ preferred.T, 0.0).sum(axis=1))
    expected = (points * mass[:, None]).sum(axis=0) / mass.sum()
    model = HandCodedStored().fit(0, DRIVING_V1, {"ann": training}).people["ann"]
    np.testing.assert_allclose(model.weights, expected, rtol=0, atol=0.02)


@pytest.mark.statistical
def test_the_calibrated_probability_is_the_average_over_weights_rationality_and_lapses():
    """By importance sampling from the prior, which few answers leave wide enough."""
    training = keeps_left(3, 8)
    n = 400_000
    rng = np.random.default_rng(2)
    points = np.abs(rng.normal(size=(n, 4)))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    rationality = np.exp(np.log(50.0) + 1.5 * rng.normal(size=(n, 1)))
    lapse_rate = expit(-3.0 + rng.normal(size=(n, 1)))

    def likely(diffs):
        return lapse_rate / 2 + (1 - lapse_rate) * expit(rationality * (points @ diffs.T))

    mass = likely(diffs_of(training.pairs) * training.signs[:, None]).prod(axis=1)
    expected = (mass @ likely(diffs_of(NEW))) / mass.sum()
    model = HandCodedCalibrated().fit(0, DRIVING_V1, {"ann": training}).people["ann"]
    np.testing.assert_allclose(model.probability_of_a(NEW), expected, rtol=0, atol=0.03)


@pytest.mark.parametrize("number", PAPERS_ACCURACY)
def test_the_stored_predictor_is_as_accurate_as_the_paper_prints(published_study, number):
    if number not in published_study:
        pytest.skip(f"the files of person {number} are not here")
    person = published_study[number]
    stored = person.posterior_samples[-1].mean(axis=0)
    compared = Pairs(person.training_states[:, 0], person.training_states[:, 1])
    asked = Pairs(person.test_states[:, 0], person.test_states[:, 1])
    training = Training(compared, person.training.signs, stored)
    model = HandCodedStored().fit(0, DRIVING_V1, {"p": training}).people["p"]
    right = (model.probability_of_a(asked) > 0.5) == (person.test.signs > 0)
    assert round(float(right.mean()), 4) == PAPERS_ACCURACY[number]
