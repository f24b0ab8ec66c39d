"""Every predictor keeps the contract of `study_core.predictors.predictor`."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.predictors.alone import Alone
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.personal_network import FEWEST_ANSWERS
from study_core.predictors.predictor import Fitted, Pairs, PersonModel, Predictor, Training
from study_core.predictors.registry import all_predictors

PREDICTORS = (*all_predictors(n_threads=1), Alone(Hierarchical()))

every_predictor = pytest.mark.parametrize("predictor", PREDICTORS, ids=lambda predictor: predictor.name)


def pairs(seed, n):
    controls = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, n, 10))
    return Pairs(DRIVING_V1.rollout(controls[0]), DRIVING_V1.rollout(controls[1]))


def somebody(seed, n=40, weights=(0.3, 0.9, 0.2, 0.2)):
    """Someone who answers by the hand-coded features, without a doubt; the study stored a mean that is near."""
    compared = pairs(seed, n)
    diffs = DRIVING_V1.features(compared.states_a) - DRIVING_V1.features(compared.states_b)
    return Training(compared, np.sign(diffs @ np.array(weights)), np.array(weights) + 0.05)


PEOPLE = {"ann": somebody(1), "bob": somebody(2, 30, (0.9, 0.1, 0.3, 0.1)), "cem": somebody(3)}
NEW = pairs(11, 25)


@pytest.fixture(scope="module")
def fitted():
    """Everyone's fit, once for each predictor."""
    known = {}

    def fit(predictor):
        if predictor.name not in known:
            known[predictor.name] = predictor.fit(5, DRIVING_V1, PEOPLE)
        return known[predictor.name]

    return fit


def test_every_name_is_one_predictors():
    names = [predictor.name for predictor in PREDICTORS]
    assert len(set(names)) == len(names)


def in_both_orders(compared):
    """Every pair and its mirror image: whoever always gives the same letter says nothing about what they like."""
    return Pairs(
        np.concatenate([compared.states_a, compared.states_b]),
        np.concatenate([compared.states_b, compared.states_a]),
    )


MIRRORED = in_both_orders(pairs(41, 20))
EXTREME = {
    "always A": Training(MIRRORED, np.full(40, 1.0)),
    "always B": Training(MIRRORED, np.full(40, -1.0)),
    "as few as can be": somebody(42, FEWEST_ANSWERS),
}


@every_predictor
def test_whoever_gives_one_letter_only_or_hardly_any_answer_is_predicted_all_the_same(predictor):
    known = predictor.fit(5, DRIVING_V1, EXTREME).people
    for person in EXTREME:
        probabilities = known[person].probability_of_a(NEW)
        assert np.isfinite(probabilities).all()
        assert ((probabilities > 0.0) & (probabilities < 1.0)).all()
    if predictor.name in ("hand-coded-stored", "hand-coded-calibrated"):
        for person in ("always A", "always B"):
            assert np.abs(known[person].probability_of_a(NEW) - 0.5).mean() < 0.1


@every_predictor
def test_it_has_the_members_of_the_contract(predictor, fitted):
    assert isinstance(predictor, Predictor)
    found = fitted(predictor)
    assert isinstance(found, Fitted)
    assert set(found.people) == set(PEOPLE)
    assert all(isinstance(person, PersonModel) for person in found.people.values())


@every_predictor
def test_probabilities_are_finite_and_neither_0_nor_1(predictor, fitted):
    for person in fitted(predictor).people.values():
        probabilities = person.probability_of_a(NEW)
        assert probabilities.shape == (25,)
        assert np.isfinite(probabilities).all()
        assert (probabilities > 0.0).all()
        assert (probabilities < 1.0).all()


@every_predictor
def test_the_same_seed_gives_the_same_bits_whatever_the_order_of_the_people(predictor, fitted):
    again = predictor.fit(5, DRIVING_V1, dict(reversed(PEOPLE.items())))
    for name, person in fitted(predictor).people.items():
        np.testing.assert_array_equal(person.probability_of_a(NEW), again.people[name].probability_of_a(NEW))


@every_predictor
def test_a_and_b_exchanged_exchange_the_probabilities(predictor, fitted):
    turned = Pairs(NEW.states_b, NEW.states_a)
    for person in fitted(predictor).people.values():
        both = person.probability_of_a(NEW) + person.probability_of_a(turned)
        np.testing.assert_allclose(both, 1.0, rtol=0, atol=1e-5)


@every_predictor
def test_each_pair_is_predicted_on_its_own(predictor, fitted):
    person = fitted(predictor).people["ann"]
    whole = person.probability_of_a(NEW)
    np.testing.assert_allclose(person.probability_of_a(NEW[3:9]), whole[3:9], rtol=0, atol=1e-6)
    assert person.probability_of_a(NEW[:0]).shape == (0,)


@every_predictor
def test_it_learns_from_the_answers(predictor, fitted):
    """People are predicted better than by the toss of a coin, on pairs that nobody has answered."""
    right = []
    for name, weights in {"ann": (0.3, 0.9, 0.2, 0.2), "bob": (0.9, 0.1, 0.3, 0.1)}.items():
        asked = somebody(21, 80, weights)
        likely = fitted(predictor).people[name].probability_of_a(asked.pairs)
        right.append(((likely > 0.5) == (asked.signs > 0)).mean())
    assert np.mean(right) > 0.65


@every_predictor
def test_nothing_that_is_given_is_changed(predictor):
    kept = somebody(1)
    given = replace(kept, signs=kept.signs.copy(), stored_mean=kept.stored_mean.copy())
    for values in (given.pairs.states_a, given.pairs.states_b, given.signs, given.stored_mean):
        values.setflags(write=False)
    predictor.fit(5, DRIVING_V1, {"ann": given}).people["ann"].probability_of_a(NEW)


@every_predictor
@pytest.mark.parametrize("n", [0, 1, 5, 30])
def test_somebody_new_is_predicted_from_few_answers_or_none(predictor, fitted, n):
    found = fitted(predictor)
    one, again = (found.with_person(8, somebody(31).first(n)).probability_of_a(NEW) for _ in range(2))
    np.testing.assert_array_equal(one, again)
    assert np.isfinite(one).all()
    assert ((one > 0.0) & (one < 1.0)).all()


@every_predictor
def test_somebody_new_changes_nobody_else(predictor, fitted):
    found = fitted(predictor)
    before = found.people["ann"].probability_of_a(NEW)
    found.with_person(8, somebody(32))
    np.testing.assert_array_equal(found.people["ann"].probability_of_a(NEW), before)
