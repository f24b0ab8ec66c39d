"""Somebody new is predicted from the others and from their own first answers, and from nothing else."""

from dataclasses import dataclass, field

import numpy as np

from study_core.domains.driving import DRIVING_V1
from study_core.evaluation.learning_curve import learning_curve, majority_accuracy
from study_core.evaluation.people import Person, TestAnswers
from study_core.predictors.predictor import Pairs, Training


def pairs(seed, n):
    rng = np.random.default_rng(seed)
    return Pairs(rng.normal(size=(n, 3, 2)), rng.normal(size=(n, 3, 2)))


def person(name, seed, test_signs, shared=7):
    training = Training(pairs(seed, 8), np.resize([1.0, -1.0], 8))
    return Person(name, training, TestAnswers(pairs(shared, len(test_signs)), np.array(test_signs)))


@dataclass
class Surer:
    """Is the surer of A, the more own answers it was given; keeps what it learned from."""

    name: str = "surer"
    learned_from: list = field(default_factory=list)

    def fit(self, seed, domain, people):
        self.learned_from.append(set(people))
        return self

    @property
    def people(self):
        return {}

    def with_person(self, seed, training):
        class Model:
            def probability_of_a(self, pairs):
                return np.full(len(pairs), 0.5 + 0.05 * len(training))

        return Model()


def test_nobody_is_learned_from_before_they_are_predicted():
    everybody = [person(name, k, [1.0, 1.0, -1.0]) for k, name in enumerate("abc")]
    predictor = Surer()
    curve = learning_curve(0, DRIVING_V1, everybody, predictor, (0, 4, 100))
    assert predictor.learned_from == [{"b", "c"}, {"a", "c"}, {"a", "b"}]
    np.testing.assert_allclose([curve[n]["a"].expected_accuracy for n in (0, 4)], [0.5, 0.7])
    # Nobody has given more than eight.
    np.testing.assert_allclose(curve[100]["b"].expected_accuracy, 0.9)
    np.testing.assert_allclose(curve[4]["c"].accuracy, 2 / 3)


def test_whoever_knows_nobody_else_is_fitted_to_nobody():
    predictor = Surer()
    curve = learning_curve(
        0, DRIVING_V1, [person("a", 1, [1.0, -1.0])], predictor, (0, 4), knows_others=False
    )
    assert predictor.learned_from == [set()]
    np.testing.assert_allclose(curve[4]["a"].expected_accuracy, 0.7)


def test_the_majority_is_that_of_the_others_who_saw_the_same():
    signs = {"a": [1.0, 1.0, -1.0], "b": [1.0, -1.0, -1.0], "c": [1.0, -1.0, 1.0]}
    everybody = [person(name, k, values) for k, (name, values) in enumerate(signs.items())]
    elsewhere = person("d", 9, [1.0, 1.0, 1.0], shared=8)
    found = majority_accuracy([*everybody, elsewhere])
    # a: the others agree on A, on B, and not; b: on A, not, not; c: on A, not, on B.
    assert found == {"a": (1 + 0 + 0.5) / 3, "b": (1 + 0.5 + 0.5) / 3, "c": (1 + 0.5 + 0) / 3}
