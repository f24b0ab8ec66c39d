"""The networks' predictors: what they return, what they fall back to, and what they must not spoil."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.errors import TooFewAnswersError
from study_core.networks.config import NetworkConfig
from study_core.predictors.hand_coded import HandCodedCalibrated, PosteriorModel
from study_core.predictors.personal_calibrated import SHARES, PersonalCalibrated
from study_core.predictors.personal_network import PUBLISHED_CODE, PersonalNetwork
from study_core.predictors.predictor import Pairs, Training
from tests.study_core.networks.people import keeps_left, pairs

SMALL = PersonalNetwork(replace(PUBLISHED_CODE, n_trials=6, n_epochs=10))
NEW = pairs(3, 30)
NETWORKS = [SMALL, PersonalCalibrated()]
both = pytest.mark.parametrize("predictor", NETWORKS, ids=lambda predictor: predictor.name)


def test_the_probability_is_the_mean_of_the_selected_networks():
    model = SMALL.fit(0, DRIVING_V1, {"ann": keeps_left(1, 30)}).people["ann"]
    members = model.members_probability_of_a(NEW)
    assert members.shape == (5, 30)
    assert members.std(axis=0).min() > 0.0
    np.testing.assert_allclose(model.probability_of_a(NEW), members.mean(axis=0), rtol=0, atol=1e-15)


def test_independent_trials_have_a_name_of_their_own():
    assert PersonalNetwork().name == "personal-network"
    assert PersonalNetwork(NetworkConfig()).name == "personal-network-independent"


@both
def test_fewer_than_ten_answers_are_refused_by_name(predictor):
    with pytest.raises(TooFewAnswersError, match=r"at least 10 answers of bob for 'personal-.+', got 9\."):
        predictor.fit(0, DRIVING_V1, {"ann": keeps_left(1, 30), "bob": keeps_left(2, 9)})


def test_people_who_are_learned_in_threads_are_the_same_to_the_last_bit():
    people = {name: keeps_left(seed, 12) for seed, name in enumerate("abc")}
    alone, together = (
        PersonalNetwork(SMALL.config, n_threads=n).fit(0, DRIVING_V1, people).people for n in (1, 3)
    )
    assert list(alone) == list(together) == list(people)
    for name, model in alone.items():
        np.testing.assert_array_equal(model.probability_of_a(NEW), together[name].probability_of_a(NEW))


@both
@pytest.mark.parametrize("n", [0, 9])
def test_somebody_new_with_fewer_than_ten_answers_is_known_by_the_calibrated_posterior(predictor, n):
    found = predictor.fit(0, DRIVING_V1, {})
    model = found.with_person(1, keeps_left(2, 40).first(n))
    assert isinstance(model, PosteriorModel)
    expected = HandCodedCalibrated().fit(0, DRIVING_V1, {}).with_person(1, keeps_left(2, 40).first(n))
    # Streams of other names: equal but for Monte Carlo error.
    np.testing.assert_allclose(model.probability_of_a(NEW), expected.probability_of_a(NEW), rtol=0, atol=0.08)


@both
def test_somebody_new_with_enough_answers_gets_networks_even_without_a_stored_mean(predictor):
    model = predictor.fit(0, DRIVING_V1, {}).with_person(1, keeps_left(2, 40).first(12))
    assert len(model.networks) >= 5


def test_the_calibrated_network_learns_what_the_hand_coded_features_cant_say():
    training, held_out = keeps_left(4, 120), keeps_left(5, 200)
    losses = []
    for predictor in (HandCodedCalibrated(), PersonalCalibrated()):
        likely = (
            predictor.fit(0, DRIVING_V1, {"ann": training}).people["ann"].probability_of_a(held_out.pairs)
        )
        losses.append(-np.log(np.where(held_out.signs > 0, likely, 1 - likely)).mean())
    assert losses[1] < 0.75 * losses[0]


def test_with_nothing_believed_it_is_the_calibrated_posterior():
    predictor, training = PersonalCalibrated(), keeps_left(6, 30)
    model = predictor.fit(0, DRIVING_V1, {"ann": training}).people["ann"]
    diffs = DRIVING_V1.features(NEW.states_a) - DRIVING_V1.features(NEW.states_b)
    np.testing.assert_allclose(
        replace(model, share=0.0).probability_of_a(NEW),
        model.posterior.probability_of_a(diffs),
        rtol=0,
        atol=1e-12,
    )


def test_the_share_has_the_smallest_cross_validated_loss_so_none_is_worse_than_nothing(monkeypatch):
    seen = []
    original = PersonalCalibrated.cross_validated_losses

    def recorded(self, rng, domain, training):
        seen.append(original(self, rng, domain, training))
        return seen[-1]

    monkeypatch.setattr(PersonalCalibrated, "cross_validated_losses", recorded)
    model = PersonalCalibrated().fit(0, DRIVING_V1, {"ann": keeps_left(7, 40)}).people["ann"]
    (losses,) = seen
    assert SHARES[0] == 0.0
    assert losses[SHARES.index(model.share)] == losses.min() <= losses[0]
    assert model.share > 0.0


def test_answers_by_the_toss_of_a_coin_are_believed_little():
    training = keeps_left(8, 60)
    signs = np.random.default_rng(1).choice([-1.0, 1.0], 60)
    model = PersonalCalibrated().fit(0, DRIVING_V1, {"ann": replace(training, signs=signs)}).people["ann"]
    assert model.share <= 0.3


@pytest.mark.slow
@pytest.mark.statistical
def test_on_the_published_study_networks_gain_what_the_paper_says_they_do(published_study):
    """The paper's mean of these ten people's red bars is 0.706, that of their blue ones 0.621."""
    ten = {1, 3, 4, 6, 7, 9, 10, 12, 13, 15}
    if not ten <= set(published_study):
        pytest.skip("the files of the ten people whose bars are compared are not all here")
    people = {
        str(number): Training(
            Pairs(person.training_states[:, 0], person.training_states[:, 1]),
            person.training.signs,
            person.posterior_samples[-1].mean(axis=0),
        )
        for number, person in published_study.items()
        if number in ten
    }
    fitted = PersonalNetwork(n_threads=2).fit(0, DRIVING_V1, people)
    accuracies = []
    for name, model in fitted.people.items():
        person = published_study[int(name)]
        asked = Pairs(person.test_states[:, 0], person.test_states[:, 1])
        predicted = model.members_probability_of_a(asked) > 0.5
        accuracies.append((predicted == (person.test.signs > 0)).mean())
    assert np.mean(accuracies) == pytest.approx(0.706, abs=0.05)
    assert np.mean(accuracies) > 0.621 + 0.03
