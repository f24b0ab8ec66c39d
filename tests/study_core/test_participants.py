"""Simulated people answer by their own weights, the response model and their habits."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, Query
from study_core.participants import Habits, SimulatedPerson, alignment, draw_person
from study_core.posterior.prior import Prior

MODEL = ResponseModel("sigmoid", 200.0, 0.1)
EVERY_ANSWER = (Choice.A, Choice.B, Choice.SAME, Choice.UNSURE, Choice.SKIP)


def person(parameters=None, answers=(Choice.A, Choice.B), **habits):
    told = parameters or ResponseParameters.constant(1, 200.0, 0.1)
    return SimulatedPerson(np.array([1.0, 0.0]), told, answers, Habits(**habits))


def query(difference):
    return Query(np.zeros(2), np.ones(2), np.array([difference, 0.0]), np.zeros(2))


def sigmoid(log_odds):
    return 1 / (1 + math.exp(-log_odds))


def assert_chosen_as_often(simulated, choice, difference, expected):
    rng = np.random.default_rng(3)
    n_chosen = sum(simulated.choose(rng, query(difference)) is choice for _ in range(2000))
    assert binomtest(n_chosen, 2000, expected).pvalue > 1e-4


@pytest.mark.statistical
@pytest.mark.parametrize("difference", [-1.0, -0.005, 0.0, 0.005, 1.0])
def test_a_person_chooses_as_often_as_the_response_model_says(difference):
    assert_chosen_as_often(person(), Choice.A, difference, 0.05 + 0.9 * sigmoid(200.0 * difference))


@pytest.mark.statistical
@pytest.mark.parametrize("difference", [-0.02, 0.0, 0.005])
def test_a_person_finds_drives_the_same_as_often_as_the_threshold_says(difference):
    indifferent = person(ResponseParameters.constant(1, 200.0, 0.1, 1.5), EVERY_ANSWER[:3])
    utility = 200.0 * difference
    same = 1 - sigmoid(utility - 1.5) - sigmoid(-utility - 1.5)
    assert_chosen_as_often(indifferent, Choice.SAME, difference, 0.1 / 3 + 0.9 * same)


@pytest.mark.statistical
@pytest.mark.parametrize("side_bias", [-2.0, 0.7])
def test_a_side_bias_shifts_the_log_odds_of_a(side_bias):
    expected = 0.05 + 0.9 * sigmoid(200.0 * 0.002 + side_bias)
    assert_chosen_as_often(person(side_bias=side_bias), Choice.A, 0.002, expected)


@pytest.mark.statistical
def test_somebody_unsure_uses_every_answer_that_says_nothing_alike():
    unsure = person(ResponseParameters.constant(1, 200.0, 0.1, 1.0), EVERY_ANSWER, unsure_rate=0.3)
    for choice in (Choice.UNSURE, Choice.SKIP):
        assert_chosen_as_often(unsure, choice, 0.01, 0.15)


def test_nobody_is_unsure_where_the_study_does_not_offer_it():
    assert person(unsure_rate=0.9).probabilities(query(0.004)) == person().probabilities(query(0.004))


@pytest.mark.parametrize("difference", [-3.0, -0.01, 0.0, 0.002, 0.3])
def test_the_answers_that_are_offered_have_all_of_the_probability(difference):
    odd = person(ResponseParameters.constant(1, 50.0, 0.2, 0.8), EVERY_ANSWER, side_bias=0.4, unsure_rate=0.1)
    probabilities = odd.probabilities(query(difference))
    assert tuple(probabilities) == EVERY_ANSWER
    assert sum(probabilities.values()) == pytest.approx(1.0, abs=1e-12)


def test_a_perfectly_rational_person_prefers_the_higher_reward():
    rational = person(ResponseParameters.constant(1, 1e6))
    rng = np.random.default_rng(4)
    assert {rational.choose(rng, query(0.3)) for _ in range(50)} == {Choice.A}
    assert {rational.choose(rng, query(-0.3)) for _ in range(50)} == {Choice.B}


def test_taste_drifts_by_the_stated_angle_and_keeps_its_length():
    weights = 0.7 * np.array([0.5, 0.5, 0.5, 0.5])
    steady = SimulatedPerson(weights, ResponseParameters.constant(1, 1.0), habits=Habits(drift_rad=0.05))
    rng = np.random.default_rng(5)
    moved = np.array([steady.drifted(rng).weights for _ in range(2000)])
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.7, rtol=1e-12)
    angles = np.arccos(np.clip(moved @ weights / 0.7**2, -1.0, 1.0))
    # Of 2,000 squared angles, each a sum of three squared normals: the standard error is 1.8 %.
    assert np.mean(angles**2) == pytest.approx(0.05**2, rel=0.08)


def test_a_firm_taste_stays_and_costs_no_randomness():
    firm = person()
    rng = np.random.default_rng(6)
    assert firm.drifted(rng) is firm
    assert rng.random() == np.random.default_rng(6).random()


@pytest.mark.statistical
def test_a_crowd_whose_taste_drifts_stays_uniform_on_the_nonnegative_sphere():
    rng = np.random.default_rng(7)
    people = [
        SimulatedPerson(weights, ResponseParameters.constant(1, 1.0), habits=Habits(drift_rad=0.8))
        for weights in Prior("sphere", 4).draw(rng, 1500)
    ]
    for _ in range(6):
        people = [each.drifted(rng) for each in people]
    weights = np.array([each.weights for each in people])
    assert weights.min() >= 0.0
    # Of a uniform direction in four dimensions: E w_k = 4 / (3 pi), E w_k^2 = 1/4, E w_j w_k = 1 / (2 pi).
    np.testing.assert_allclose(weights.mean(axis=0), 4 / (3 * math.pi), atol=4.5 * 0.265 / math.sqrt(1500))
    np.testing.assert_allclose(np.mean(weights**2, axis=0), 0.25, atol=4.5 * 0.25 / math.sqrt(1500))
    products = [np.mean(weights[:, j] * weights[:, k]) for j in range(4) for k in range(j)]
    np.testing.assert_allclose(products, 1 / (2 * math.pi), atol=4.5 * 0.13 / math.sqrt(1500))


def test_a_number_is_always_the_same_person_and_numbers_are_different_people():
    people = [draw_person(1, number, Prior("sphere", 4), MODEL) for number in (1, 2, 1)]
    np.testing.assert_array_equal(people[0].weights, people[2].weights)
    assert not np.array_equal(people[0].weights, people[1].weights)
    assert np.linalg.norm(people[0].weights) == pytest.approx(1.0)
    changed = draw_person(1, 1, Prior("sphere", 4), MODEL, habits=Habits(drift_rad=0.1, side_bias=1.0))
    np.testing.assert_array_equal(people[0].weights, changed.weights)


def test_alignment_is_a_cosine():
    assert alignment(np.array([1.0, 0.0]), np.array([5.0, 0.0])) == pytest.approx(1.0)
    assert alignment(np.array([1.0, 0.0]), np.array([1.0, 1.0])) == pytest.approx(math.sqrt(0.5))
    assert alignment(np.array([1.0, 0.0]), np.array([0.0, 2.0])) == 0.0
