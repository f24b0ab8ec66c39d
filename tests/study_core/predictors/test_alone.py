"""Cut off from other people: the same model, fitted to one person's answers and to nothing else."""

import numpy as np
import pytest

from study_core.predictors.alone import Alone
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.predictor import Pairs, Training
from tests.study_core.hills import HillsDomain

DOMAIN = HillsDomain()


def pairs_of(seed, n):
    states = DOMAIN.rollout(np.random.default_rng(seed).uniform(-1.0, 1.0, (2 * n, 2)))
    return Pairs(states[:n], states[n:])


def goes(direction, seed, n):
    """Somebody who likes to go east (+1) or west (-1), without a doubt."""
    pairs = pairs_of(seed, n)
    return Training(pairs, direction * np.sign((pairs.states_a - pairs.states_b)[:, 0, 0]))


NEW_PAIRS = pairs_of(99, 60)
WESTERNERS = {str(seed): goes(-1.0, seed, 40) for seed in range(4)}


@pytest.fixture
def alone():
    return Alone(Hierarchical())


def test_it_is_the_other_predictor_fitted_to_one_person(alone):
    training = goes(1.0, 10, 20)
    expected = Hierarchical().fit(0, DOMAIN, {"she": training}).people["she"]
    for found in (
        alone.fit(0, DOMAIN, {}).with_person(0, training),
        alone.fit(0, DOMAIN, {"she": training}).people["she"],
    ):
        np.testing.assert_array_equal(found.probability_of_a(NEW_PAIRS), expected.probability_of_a(NEW_PAIRS))


def test_what_others_prefer_has_no_part_in_it(alone):
    """Whoever knows four people that go west expects it of somebody who has gone east three times."""
    east = NEW_PAIRS.states_a[:, 0, 0] > NEW_PAIRS.states_b[:, 0, 0]
    few = goes(1.0, 11, 3)
    told, untold = (alone.fit(0, DOMAIN, others).with_person(0, few) for others in (WESTERNERS, {}))
    np.testing.assert_array_equal(told.probability_of_a(NEW_PAIRS), untold.probability_of_a(NEW_PAIRS))
    assert np.mean((told.probability_of_a(NEW_PAIRS) > 0.5) == east) > 0.6
    with_others = Hierarchical().fit(0, DOMAIN, WESTERNERS).with_person(0, few)
    assert np.mean((with_others.probability_of_a(NEW_PAIRS) > 0.5) == east) < 0.4


def test_before_the_first_answer_it_is_a_coin(alone):
    for known in (
        alone.fit(0, DOMAIN, {}).with_person(0, goes(1.0, 12, 0)),
        alone.fit(0, DOMAIN, {"he": goes(1.0, 12, 0)}).people["he"],
    ):
        np.testing.assert_array_equal(known.probability_of_a(NEW_PAIRS), 0.5)


def test_the_coin_is_what_a_model_without_answers_says():
    """An answer to a pair of equal trajectories says nothing, so what is left is the model's prior predictive."""
    same = pairs_of(13, 1)
    nothing = Training(
        Pairs(np.concatenate([same.states_a, same.states_b]), np.concatenate([same.states_a, same.states_b])),
        np.array([1.0, -1.0]),
    )
    found = Hierarchical().fit(0, DOMAIN, {"he": nothing}).people["he"]
    np.testing.assert_allclose(found.probability_of_a(NEW_PAIRS), 0.5, atol=1e-12)
