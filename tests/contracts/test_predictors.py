"""Every predictor keeps the contract: it learns, it is honest about both sides, and nothing but the answers matters."""

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.errors import TooFewAnswersError
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.predictor import Fitted, Pairs, PersonModel, Predictor, Training
from study_core.predictors.shared_network import SharedNetwork

PREDICTORS = [Hierarchical(), SharedNetwork()]

every_predictor = pytest.mark.parametrize("predictor", PREDICTORS, ids=lambda predictor: predictor.name)

# What the people below care for: lane, speed, heading, collision; the last one more than the first two.
TASTES = {
    "ada": np.array([0.5, 0.4, 0.3, 0.7]),
    "ben": np.array([0.4, 0.5, 0.3, 0.7]),
    "cleo": np.array([0.2, 0.2, 0.3, 0.9]),
}
N_ANSWERS = 40


def random_pairs(seed, n):
    controls = np.random.default_rng(seed).uniform(-1.0, 1.0, (2 * n, 10))
    states = DRIVING_V1.rollout(controls)
    return Pairs(states[:n].copy(), states[n:].copy())


def answers_of(taste, pairs):
    """Somebody who never lapses and always sees a difference."""
    difference = DRIVING_V1.features(pairs.states_a) - DRIVING_V1.features(pairs.states_b)
    return np.where(difference @ taste > 0, 1.0, -1.0)


def training_of(seed, taste, n=N_ANSWERS):
    pairs = random_pairs(seed, n)
    return Training(pairs, answers_of(taste, pairs), stored_mean=taste / np.linalg.norm(taste))


def everybody():
    return {name: training_of(seed, taste) for seed, (name, taste) in enumerate(TASTES.items())}


NEW_PAIRS = random_pairs(100, 50)


@pytest.fixture(scope="module")
def fitted_of():
    """Each predictor's fit to everybody, made once."""
    kept = {}

    def fitted(predictor):
        if predictor.name not in kept:
            kept[predictor.name] = predictor.fit(7, DRIVING_V1, everybody())
        return kept[predictor.name]

    return fitted


def test_no_two_have_the_same_name():
    names = [predictor.name for predictor in PREDICTORS]
    assert len(set(names)) == len(names)


@every_predictor
def test_it_is_a_predictor_of_people(predictor, fitted_of):
    assert isinstance(predictor, Predictor)
    fitted = fitted_of(predictor)
    assert isinstance(fitted, Fitted)
    assert set(fitted.people) == set(TASTES)
    assert all(isinstance(person, PersonModel) for person in fitted.people.values())


@every_predictor
def test_probabilities_are_neither_certain_nor_impossible(predictor, fitted_of):
    for person in fitted_of(predictor).people.values():
        probabilities = person.probability_of_a(NEW_PAIRS)
        assert probabilities.shape == (len(NEW_PAIRS),)
        assert ((probabilities > 0) & (probabilities < 1)).all()
        assert person.probability_of_a(NEW_PAIRS[:0]).shape == (0,)


@every_predictor
def test_swapping_a_and_b_swaps_the_probabilities(predictor, fitted_of):
    swapped = Pairs(NEW_PAIRS.states_b, NEW_PAIRS.states_a)
    for person in fitted_of(predictor).people.values():
        both = person.probability_of_a(NEW_PAIRS) + person.probability_of_a(swapped)
        np.testing.assert_allclose(both, 1.0, atol=1e-9)


@every_predictor
def test_each_pair_is_judged_by_itself(predictor, fitted_of):
    person = fitted_of(predictor).people["ada"]
    one_by_one = [person.probability_of_a(NEW_PAIRS[i : i + 1])[0] for i in range(5)]
    np.testing.assert_allclose(one_by_one, person.probability_of_a(NEW_PAIRS)[:5], rtol=1e-9)


@every_predictor
def test_it_learns_what_consistent_people_would_answer(predictor, fitted_of):
    for name, person in fitted_of(predictor).people.items():
        truth = answers_of(TASTES[name], NEW_PAIRS) > 0
        assert np.mean((person.probability_of_a(NEW_PAIRS) > 0.5) == truth) > 0.7


@every_predictor
def test_somebody_new_is_learned_from_their_own_answers(predictor, fitted_of):
    taste = TASTES["cleo"]
    person = fitted_of(predictor).with_person(7, training_of(50, taste))
    assert isinstance(person, PersonModel)
    probabilities = person.probability_of_a(NEW_PAIRS)
    assert np.mean((probabilities > 0.5) == (answers_of(taste, NEW_PAIRS) > 0)) > 0.7


@every_predictor
def test_the_same_seed_gives_the_same_bits(predictor, fitted_of):
    once, again = fitted_of(predictor), predictor.fit(7, DRIVING_V1, everybody())
    newcomer = training_of(51, TASTES["ben"])
    for one, other in (
        (once.people["ada"], again.people["ada"]),
        (once.with_person(3, newcomer), again.with_person(3, newcomer)),
    ):
        np.testing.assert_array_equal(one.probability_of_a(NEW_PAIRS), other.probability_of_a(NEW_PAIRS))


@every_predictor
def test_the_order_of_people_does_not_matter(predictor, fitted_of):
    turned = predictor.fit(7, DRIVING_V1, dict(reversed(everybody().items())))
    for name, person in fitted_of(predictor).people.items():
        np.testing.assert_array_equal(
            person.probability_of_a(NEW_PAIRS), turned.people[name].probability_of_a(NEW_PAIRS)
        )


@every_predictor
def test_what_is_given_is_left_alone(predictor):
    people = everybody()
    for training in people.values():
        for values in (training.pairs.states_a, training.pairs.states_b, training.signs):
            values.flags.writeable = False
    predictor.fit(7, DRIVING_V1, people)


@every_predictor
def test_without_any_answer_it_says_so(predictor):
    with pytest.raises(TooFewAnswersError, match=r"Expected .*, got .*\."):
        predictor.fit(7, DRIVING_V1, {"ada": training_of(0, TASTES["ada"], n=0)})
