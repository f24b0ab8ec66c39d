"""Predictors are compared on people of known taste; what each predictor is given is written down and looked at."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from study_core.domains.driving.domain import DRIVING_V1
from study_core.evaluation.comparison import compare
from study_core.evaluation.people import Person, TestAnswers
from study_core.predictors.predictor import Pairs, Training

N_ACTIVE, N_TEST = 40, 30


def pairs_of(rng, n):
    return Pairs(rng.standard_normal((n, 5, 2)), rng.standard_normal((n, 5, 2)))


def utilities(weights, pairs):
    return (pairs.states_a - pairs.states_b).mean(axis=1) @ weights


def signs_of(rng, weights, pairs):
    likely = 1.0 / (1.0 + np.exp(-4.0 * utilities(weights, pairs)))
    return np.where(rng.random(len(pairs)) < likely, 1.0, -1.0)


TRUTHS = {"ann": np.array([2.0, -1.0]), "bob": np.array([-1.0, 1.5])}


@pytest.fixture
def people():
    rng = np.random.default_rng(6)
    made = []
    for name, truth in TRUTHS.items():
        active, test = pairs_of(rng, N_ACTIVE), pairs_of(rng, N_TEST)
        training = Training(active, signs_of(rng, truth, active))
        made.append(Person(name, training, TestAnswers(test, signs_of(rng, truth, test))))
    return made


@dataclass
class Model:
    weights: np.ndarray
    scale: float

    def probability_of_a(self, pairs):
        return 1.0 / (1.0 + np.exp(-self.scale * utilities(self.weights, pairs)))


@dataclass
class Fitted:
    people: dict

    def with_person(self, seed, training):
        raise NotImplementedError


@dataclass
class Known:
    """Predicts with the true weights, more or less loudly, and keeps what it was given."""

    name: str
    scale: float
    given: list = field(default_factory=list)

    def fit(self, seed, domain, people):
        self.given.append(people)
        return Fitted({name: Model(TRUTHS[name], self.scale) for name in people})


def test_the_better_calibrated_predictor_is_recommended_from_training_answers_alone(people):
    calibrated, boastful, coin = Known("calibrated", 4.0), Known("boastful", 80.0), Known("coin", 0.0)
    found = compare(0, DRIVING_V1, people, [boastful, calibrated, coin])
    assert found.recommended == "calibrated"
    assert found.validation_log_loss["coin"] == pytest.approx(np.log(2.0))
    # Test answers turned round change every score and no choice.
    turned = [Person(p.name, p.training, TestAnswers(p.test.pairs, -p.test.signs)) for p in people]
    again = compare(0, DRIVING_V1, turned, [boastful, calibrated, coin])
    assert again.recommended == "calibrated"
    assert again.validation_log_loss == found.validation_log_loss
    for name in TRUTHS:
        assert again.scores["calibrated"][name].accuracy == pytest.approx(
            1.0 - found.scores["calibrated"][name].accuracy
        )
        np.testing.assert_array_equal(
            again.probabilities_of_a["calibrated"][name], found.probabilities_of_a["calibrated"][name]
        )


def test_a_predictor_gets_the_first_active_answers_then_all_and_never_a_test_answer(people):
    predictor = Known("known", 4.0)
    compare(0, DRIVING_V1, people, [predictor])
    split, whole = predictor.given
    for person in people:
        assert len(split[person.name]) == round(0.7 * N_ACTIVE)
        np.testing.assert_array_equal(
            split[person.name].signs, person.training.signs[: len(split[person.name])]
        )
        assert whole[person.name] is person.training


def test_every_fit_is_told(people):
    told = []
    compare(0, DRIVING_V1, people, [Known("a", 1.0), Known("b", 2.0)], lambda: told.append(1))
    assert len(told) == 4
