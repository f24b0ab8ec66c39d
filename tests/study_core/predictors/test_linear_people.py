"""People on features of trajectories: scales, constant features, newcomers, and who may be left without an answer."""

import numpy as np
import pytest

from study_core.errors import TooFewAnswersError
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.linear_people import inverse_scales, learn_people
from study_core.predictors.predictor import Pairs, Training
from tests.study_core.hills import HillsDomain

DOMAIN = HillsDomain()


def pairs_of(seed, n):
    controls = np.random.default_rng(seed).uniform(-1.0, 1.0, (2 * n, 2))
    states = DOMAIN.rollout(controls)
    return Pairs(states[:n], states[n:])


def eastward(seed, n=40):
    """Somebody who likes to go east, and seldom answers at random."""
    rng, pairs = np.random.default_rng(seed + 1000), pairs_of(seed, n)
    advantage = 4.0 * (pairs.states_a - pairs.states_b)[:, 0, 0]
    return Training(pairs, np.where(advantage + rng.logistic(size=n) > 0, 1.0, -1.0))


PEOPLE = {name: eastward(seed) for seed, name in enumerate(("ada", "ben", "cleo", "dora"))}
NEW_PAIRS = pairs_of(99, 60)


def test_without_own_answers_one_is_predicted_like_the_population():
    """The weights are the population's; their spread is that of what is shared and of people around it."""
    fitted = learn_people(DOMAIN.rich_features, PEOPLE)
    nobody = eastward(5, n=0)
    found = fitted.with_person(0, nobody)
    population = fitted.population
    np.testing.assert_allclose(found.weights.mean, population.shared.mean, atol=1e-9)
    np.testing.assert_allclose(
        found.weights.covariance,
        population.shared.covariance + population.personal_scale**2 * np.eye(5),
        atol=1e-9,
    )
    probabilities = found.probability_of_a(NEW_PAIRS)
    east = NEW_PAIRS.states_a[:, 0, 0] > NEW_PAIRS.states_b[:, 0, 0]
    assert np.mean((probabilities > 0.5) == east) > 0.85


def test_the_predictive_probability_is_the_mean_over_posterior_draws():
    person = learn_people(DOMAIN.rich_features, PEOPLE).people["ada"]
    rng = np.random.default_rng(3)
    draws = rng.multivariate_normal(person.weights.mean, person.weights.covariance, 40_000)
    utilities = person.embedding.diffs(NEW_PAIRS) @ draws.T
    lapse = 1 / (1 + np.exp(-person.lapse_logit))
    expected = lapse / 2 + (1 - lapse) * (1 / (1 + np.exp(-utilities))).mean(axis=1)
    np.testing.assert_allclose(person.probability_of_a(NEW_PAIRS), expected, atol=0.01)


def test_units_of_the_features_do_not_matter():
    units = np.array([1e-3, 1.0, 50.0, 1e4, 1.0])
    one = learn_people(DOMAIN.rich_features, PEOPLE)
    other = learn_people(lambda states: DOMAIN.rich_features(states) * units, PEOPLE)
    np.testing.assert_allclose(
        one.people["ben"].probability_of_a(NEW_PAIRS),
        other.people["ben"].probability_of_a(NEW_PAIRS),
        atol=1e-6,
    )


@pytest.mark.parametrize("constant", [0.0, 3.0, 0.1, -1e6])
def test_a_constant_feature_drops_out_even_if_it_varies_later(constant):
    """0.1 isn't a sum of powers of two: its mean is off by rounding, which is no variation."""
    boundary = NEW_PAIRS.states_a.copy()

    def with_constant(states):
        told = np.full(len(states), constant)
        if states is boundary:
            told += np.arange(len(states))
        return np.column_stack([DOMAIN.rich_features(states), told])

    plain = learn_people(DOMAIN.rich_features, PEOPLE)
    extended = learn_people(with_constant, PEOPLE)
    later = Pairs(boundary, NEW_PAIRS.states_b)
    np.testing.assert_allclose(
        extended.people["ada"].probability_of_a(later), plain.people["ada"].probability_of_a(later), atol=1e-4
    )


def test_scales_are_of_all_that_was_compared():
    values = np.array([[1.0, 5.0], [2.0, 5.0], [4.0, 5.0]])
    np.testing.assert_allclose(inverse_scales(values), [1 / np.std([1.0, 2.0, 4.0]), 0.0])


def test_somebody_among_others_may_have_given_no_answer():
    fitted = learn_people(DOMAIN.rich_features, {**PEOPLE, "emil": eastward(7, n=0)})
    newcomer = fitted.with_person(0, eastward(8, n=0))
    np.testing.assert_allclose(
        fitted.people["emil"].probability_of_a(NEW_PAIRS), newcomer.probability_of_a(NEW_PAIRS), atol=1e-9
    )


def test_one_answer_of_one_person_is_enough():
    fitted = Hierarchical().fit(0, DOMAIN, {"ada": eastward(0, n=1)})
    assert np.isfinite(fitted.people["ada"].probability_of_a(NEW_PAIRS)).all()


@pytest.mark.parametrize("people", [{}, {"ada": eastward(0, n=0)}])
def test_no_answer_at_all_is_an_error(people):
    with pytest.raises(TooFewAnswersError, match="at least one person"):
        Hierarchical().fit(0, DOMAIN, people)
