"""What training learns, that it is repeatable, and how it ends."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.errors import NetworkError, TooFewAnswersError
from study_core.networks.config import NetworkConfig
from study_core.networks.selection import best_trials
from study_core.networks.training import Lesson, Trials, train
from study_core.predictors.personal_network import examples
from tests.study_core.networks.people import STORED_MEAN, keeps_left, random_lesson

FAST = NetworkConfig(n_trials=4, n_selected=2)


def lesson_of(config, training):
    weights = STORED_MEAN if config.has_hand_coded else np.empty(0)
    return Lesson(examples(DRIVING_V1, config, training.pairs), training.signs, weights)


def run(config, training, seed=1, **options):
    return train(np.random.default_rng(seed), config, lesson_of(config, training), **options)


VARIANTS = {
    "hand-coded and one network": FAST,
    "network alone": replace(FAST, has_hand_coded=False),
    "two features": replace(FAST, n_features=2),
    "five inputs": replace(FAST, inputs=DRIVING_V1.network_input_names),
    "continued": replace(FAST, procedure="continued"),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_planted_feature_is_learned(variant):
    """Nobody's weights of the hand-coded features say that left is better."""
    config, training = VARIANTS[variant], keeps_left(2, 150)
    trials = run(config, training)
    assert (trials.losses[-1, -1] < trials.losses[0, 0]) or config.procedure == "independent"
    assert trials.losses[:, -1].mean() < trials.losses[:, 0].mean()
    best = best_trials(trials, config.n_selected)
    held_out = keeps_left(3, 200)
    logits = trials.networks[best].logits(examples(DRIVING_V1, config, held_out.pairs)).mean(axis=0)
    by_hand = np.sign(lesson_of(FAST, held_out).pairs.hand_coded_diffs @ STORED_MEAN) == held_out.signs
    assert (np.sign(logits) == held_out.signs).mean() > 0.85
    assert by_hand.mean() < 0.65


@pytest.mark.parametrize("procedure", ["independent", "continued"])
def test_the_same_seed_gives_the_same_bits_however_many_threads_there_are(procedure):
    config, training = replace(FAST, procedure=procedure, n_epochs=5), keeps_left(4, 20)
    first, again = (run(config, training, n_threads=n) for n in (1, 3))
    np.testing.assert_array_equal(first.losses, again.losses)
    np.testing.assert_array_equal(first.networks.packed, again.networks.packed)
    np.testing.assert_array_equal(first.networks.linear_weights, again.networks.linear_weights)
    other = run(config, training, seed=2)
    assert not np.array_equal(first.losses, other.losses)


def test_a_trial_doesnt_depend_on_how_many_there_are():
    training = keeps_left(4, 20)
    few, more = (run(replace(FAST, n_trials=n, n_epochs=3), training) for n in (2, 4))
    np.testing.assert_array_equal(few.losses, more.losses[:2])


def test_a_continued_trial_takes_the_last_ones_network_and_new_linear_weights():
    """Four trials of five epochs are twenty epochs of one network, but for the linear weights."""
    lesson = lesson_of(FAST, keeps_left(5, 30))
    config = replace(FAST, procedure="continued", n_epochs=5, epochs_per_linear_update=100)
    trials = train(np.random.default_rng(1), config, lesson)
    np.testing.assert_array_equal(trials.networks.linear_weights[:, :4], np.tile(STORED_MEAN, (4, 1)))
    assert len(np.unique(trials.networks.linear_weights[:, 4])) == 4
    steps = np.abs(np.diff(trials.networks.packed, axis=0)).max(axis=1)
    # Five steps of about 0.001: nothing is drawn anew, as independent trials are.
    assert (steps > 0).all()
    assert (steps < 0.02).all()


def test_the_validation_answers_teach_nothing():
    training = keeps_left(6, 40)
    turned = replace(training, signs=np.append(training.signs[:28], -training.signs[28:]))
    one, other = run(FAST, training), run(FAST, turned)
    np.testing.assert_array_equal(one.networks.packed, other.networks.packed)
    np.testing.assert_allclose(one.validation_accuracies + other.validation_accuracies, 1.0)


def test_progress_rises_to_one():
    told = []
    run(replace(FAST, n_epochs=1), keeps_left(7, 10), on_progress=told.append)
    assert told == [0.25, 0.5, 0.75, 1.0]


def test_the_best_trials_are_the_most_accurate_and_then_the_likeliest():
    trials = run(replace(FAST, n_epochs=1), keeps_left(7, 10))
    scored = Trials(
        trials.networks,
        trials.losses,
        np.array([0.5, 0.3, 0.4, 0.1]),
        np.array([0.9, 0.8, 0.9, 0.7]),
    )
    assert best_trials(scored, 3).tolist() == [2, 0, 1]


@pytest.mark.parametrize("n", [0, 1])
def test_too_few_answers_are_refused(n):
    with pytest.raises(TooFewAnswersError, match=rf"got {n}\."):
        train(np.random.default_rng(1), FAST, random_lesson(1, n=n))


def test_training_that_diverges_is_an_error_and_not_a_number():
    lesson = random_lesson(1)
    lesson.pairs.inputs_a[0, 0, 0] = np.inf
    with pytest.raises(NetworkError, match="diverged"):
        train(np.random.default_rng(1), replace(FAST, n_epochs=2), lesson)
