"""Predictions of the published test answers: the numbers by hand, and what is learned from whom."""

import math

import numpy as np
import pytest

from study_core.choice import ResponseParameters
from study_core.comparison import ComparisonSet
from study_core.evaluation import hand_coded
from study_core.evaluation.hand_coded import MODELS, predict, stored_accuracy
from study_core.evaluation.intervals import bootstrap_interval
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior, SamplerSettings
from study_core.published import PublishedPerson

FEW = SamplerSettings(n_chains=4, n_warmup=100, n_draws=300, most_draws=300, n_samples=200)


def somebody(test_signs=None):
    """Someone who only cares for the first feature."""
    rng = np.random.default_rng(4)
    training, test = rng.normal(0, 0.2, (60, 4)), rng.normal(0, 0.2, (40, 4))
    signs = np.sign(test[:, 0]) if test_signs is None else test_signs
    return PublishedPerson(
        number=3,
        training=ComparisonSet(training, np.sign(training[:, 0])),
        test=ComparisonSet(test, signs),
        training_states=np.zeros((60, 2, 50, 4)),
        test_states=np.zeros((40, 2, 50, 4)),
        posterior_samples=(np.zeros((100, 4)), np.tile([1.0, 0.0, 0.0, 0.0], (100, 1))),
    )


@pytest.mark.parametrize("name", ["beta 50", "inferred, sphere"])
def test_someone_consistent_is_predicted(monkeypatch, name):
    monkeypatch.setattr(hand_coded, "SETTINGS", FEW)
    found = predict(1, name, somebody())
    assert found.accuracy > 0.85
    assert found.log_loss < 0.4


def test_the_test_answers_decide_only_the_scores_and_not_the_fit(monkeypatch):
    """Turned around, they are predicted as badly as they were well."""
    monkeypatch.setattr(hand_coded, "SETTINGS", FEW)
    one, other = (
        predict(1, "beta 50", somebody(signs))
        for signs in (None, -np.sign(somebody().test.feature_diffs[:, 0]))
    )
    assert one.accuracy + other.accuracy == pytest.approx(1.0)
    assert other.log_loss > 1.0 > one.log_loss


def test_the_stored_accuracy_is_of_the_last_posteriors_mean():
    assert stored_accuracy(somebody()) == 1.0


def test_the_log_loss_averages_probabilities_over_samples():
    samples = np.array([[1.0, 0.0], [0.0, 1.0]])
    parameters = ResponseParameters(np.array([10.0, 20.0]), np.array([0.0, 0.2]), np.zeros(2))
    posterior = Posterior(
        samples,
        parameters,
        np.zeros(2),
        samples.mean(axis=0),
        Diagnostics(np.ones(2), np.ones(2), np.ones(2), 0.5, 2),
    )
    answers = ComparisonSet(np.array([[0.1, 0.05], [0.1, 0.05]]), np.array([1.0, -1.0]))
    likely = 0.5 * (1 / (1 + math.exp(-1.0)) + 0.1 + 0.8 / (1 + math.exp(-1.0)))
    expected = -0.5 * (math.log(likely) + math.log(1 - likely))
    assert hand_coded._log_loss(posterior, answers) == pytest.approx(expected, rel=1e-12)


@pytest.mark.statistical
def test_the_interval_is_that_of_the_mean():
    values = np.random.default_rng(1).normal(0.7, 0.1, 400)
    low, high = bootstrap_interval(np.random.default_rng(2), values)
    half_width = 1.96 * values.std() / 20.0
    assert low == pytest.approx(values.mean() - half_width, abs=0.1 * half_width)
    assert high == pytest.approx(values.mean() + half_width, abs=0.1 * half_width)


@pytest.mark.slow
@pytest.mark.statistical
def test_on_the_published_study_learning_the_rationality_beats_the_papers_one(published_study):
    """Person by person and at least ten of them, or it means nothing."""
    people = list(published_study.values())
    assert len(people) >= 10
    learned, fixed = (
        np.array([predict(0, name, person).accuracy for person in people])
        for name in ("inferred, sphere", "beta 1")
    )
    low, _ = bootstrap_interval(np.random.default_rng(1), learned - fixed)
    assert low > 0.0


def test_every_fixed_rationality_of_the_comparison_is_there():
    assert {"beta 1", "beta 10", "beta 50", "beta 200", "inferred, sphere"} <= set(MODELS)
