"""Simulated people answer by their own weights and the response model."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from study_core.choice import ResponseModel
from study_core.comparison import Choice, Query
from study_core.participants import SimulatedPerson, alignment, draw_person
from study_core.posterior.prior import Prior

MODEL = ResponseModel("sigmoid", 200.0, 0.1)


def query(difference):
    return Query(np.zeros(2), np.ones(2), np.array([difference, 0.0]), np.zeros(2))


@pytest.mark.statistical
@pytest.mark.parametrize("difference", [-1.0, -0.005, 0.0, 0.005, 1.0])
def test_a_person_chooses_as_often_as_the_response_model_says(difference):
    person = SimulatedPerson(np.array([1.0, 0.0]), MODEL)
    expected = 0.05 + 0.9 / (1 + math.exp(-200.0 * difference))
    rng = np.random.default_rng(3)
    n_a = sum(person.choose(rng, query(difference)) is Choice.A for _ in range(2000))
    assert binomtest(n_a, 2000, expected).pvalue > 1e-4


def test_a_perfectly_rational_person_prefers_the_higher_reward():
    person = SimulatedPerson(np.array([1.0, 0.0]), ResponseModel("sigmoid", 1e6))
    rng = np.random.default_rng(4)
    assert {person.choose(rng, query(0.3)) for _ in range(50)} == {Choice.A}
    assert {person.choose(rng, query(-0.3)) for _ in range(50)} == {Choice.B}


def test_a_number_is_always_the_same_person_and_numbers_are_different_people():
    people = [draw_person(1, number, Prior("sphere", 4), MODEL).weights for number in (1, 2, 1)]
    np.testing.assert_array_equal(people[0], people[2])
    assert not np.array_equal(people[0], people[1])
    assert np.linalg.norm(people[0]) == pytest.approx(1.0)


def test_alignment_is_a_cosine():
    assert alignment(np.array([1.0, 0.0]), np.array([5.0, 0.0])) == pytest.approx(1.0)
    assert alignment(np.array([1.0, 0.0]), np.array([1.0, 1.0])) == pytest.approx(math.sqrt(0.5))
    assert alignment(np.array([1.0, 0.0]), np.array([0.0, 2.0])) == 0.0
