"""A learned feature finds what the hand-coded ones miss, and never grades an answer by a network that knows it."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.comparison import ComparisonSet
from study_core.online.feature import N_FOLDS, Compared, LearnedFeature
from study_core.online.learn import learn_feature
from tests.study_core.online.simulated import STUDY, answers, side

WITHOUT_BANK = replace(STUDY, text=STUDY.text)
WITHOUT_BANK.__dict__["bank"] = None
KNOWN = answers(41)


@pytest.fixture(scope="module")
def feature() -> LearnedFeature:
    return learn_feature(STUDY, 1, 44, KNOWN)


def unexplained(values, features):
    """Returns what a linear function of the hand-coded features leaves of some values."""
    design = np.column_stack([features, np.ones(len(values))])
    return values - design @ np.linalg.lstsq(design, values, rcond=None)[0]


def test_it_finds_the_side_that_a_person_likes(feature):
    bank = STUDY.bank
    found = feature.of_trajectories(STUDY.domain, STUDY.domain.rollout(bank.controls))
    rest = unexplained(found, bank.features), unexplained(side(bank.controls), bank.features)
    assert np.corrcoef(*rest)[0, 1] > 0.4


def test_of_somebody_who_likes_the_other_side_it_finds_that():
    other = learn_feature(WITHOUT_BANK, 1, 44, answers(41, liking=-1.0))
    bank = STUDY.bank
    found = other.of_trajectories(STUDY.domain, STUDY.domain.rollout(bank.controls))
    rest = unexplained(found, bank.features), unexplained(side(bank.controls), bank.features)
    assert np.corrcoef(*rest)[0, 1] < -0.4


def test_it_varies_as_much_as_the_hand_coded_features(feature):
    states = STUDY.domain.rollout(KNOWN.controls.reshape(-1, KNOWN.controls.shape[2]))
    spread = np.sqrt(np.mean(np.var(STUDY.domain.features(states), axis=0)))
    assert feature.of_trajectories(STUDY.domain, states).std() == pytest.approx(spread, rel=1e-5)


def test_the_same_answers_teach_the_same_bits_and_other_people_have_other_streams():
    few = answers(15)
    one, same, other = (learn_feature(WITHOUT_BANK, who, 18, few) for who in (3, 3, 4))
    assert one == same
    assert hash(one) == hash(same)
    assert one.digest != other.digest


def test_an_answer_says_nothing_to_the_networks_that_grade_it():
    few = answers(20)
    signs = few.comparisons.signs.copy()
    signs[7] = -signs[7]
    turned = Compared(ComparisonSet(few.comparisons.feature_diffs, signs), few.controls)
    before, after = (learn_feature(WITHOUT_BANK, 1, 20, known) for known in (few, turned))
    n_each = len(before.checkpoint.networks) // N_FOLDS
    is_unchanged = [
        np.array_equal(
            before.checkpoint.networks.hidden_weights[row], after.checkpoint.networks.hidden_weights[row]
        )
        for row in range(N_FOLDS * n_each)
    ]
    assert is_unchanged == [row // n_each == 7 % N_FOLDS for row in range(N_FOLDS * n_each)]


def test_answers_that_prefer_neither_count_but_teach_no_network():
    few = answers(16)
    signs = few.comparisons.signs.copy()
    signs[[3, 8]] = 0.0
    with_ties = Compared(ComparisonSet(few.comparisons.feature_diffs, signs), few.controls)
    assert learn_feature(WITHOUT_BANK, 1, 16, with_ties).n_learned_from == 16


def test_its_drives_are_optima_of_rewards_that_it_has_a_part_in(feature):
    assert 0 < len(feature.drives) == len(feature.drive_weights)
    known = STUDY.knowing(replace(STUDY.knowledge, feature=feature))
    domain = known.rewards.domain

    def rewards(controls):
        return np.sum(domain.features(domain.rollout(controls)) * feature.drive_weights, axis=1)

    best = rewards(feature.drives)
    rng = np.random.default_rng(5)
    for _ in range(20):
        moved = feature.drives + rng.normal(0.0, 0.02, feature.drives.shape)
        moved = np.clip(moved, domain.control_lower, domain.control_upper)
        assert np.all(rewards(moved) <= best + 1e-4)
