"""Learning across the published people: worth more than each alone, for them and for somebody new."""

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.evaluation.hand_coded import stored_accuracy
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.predictor import Pairs, Training


def pairs_of(states):
    return Pairs(states[:, 0], states[:, 1])


@pytest.fixture(scope="module")
def trainings(published_study):
    return {
        str(number): Training(pairs_of(person.training_states), person.training.signs)
        for number, person in published_study.items()
    }


def accuracy_and_log_loss(model, person):
    probabilities = model.probability_of_a(pairs_of(person.test_states))
    likely = np.where(person.test.signs > 0, probabilities, 1 - probabilities)
    return np.mean(likely > 0.5), -np.log(likely).mean()


def test_everybody_is_predicted_better_than_by_what_the_study_stored(published_study, trainings):
    fitted = Hierarchical().fit(0, DRIVING_V1, trainings)
    assert fitted.population.has_converged
    scores = [accuracy_and_log_loss(fitted.people[str(n)], person) for n, person in published_study.items()]
    accuracy, log_loss = np.mean(scores, axis=0)
    assert accuracy >= 0.765
    assert log_loss <= 0.48
    assert accuracy > np.mean([stored_accuracy(person) for person in published_study.values()]) + 0.1


@pytest.mark.slow
def test_somebody_new_is_predicted_from_few_answers_of_their_own(published_study, trainings):
    """With 5, better than by what the study stored after 100."""
    scores = []
    for number, person in published_study.items():
        name = str(number)
        others = {other: training for other, training in trainings.items() if other != name}
        model = Hierarchical().fit(0, DRIVING_V1, others).with_person(0, trainings[name].first(5))
        scores.append(accuracy_and_log_loss(model, person))
    assert np.mean(scores, axis=0)[0] > 0.72
