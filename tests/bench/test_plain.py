import numpy as np
import pytest

from app.bench import plain
from app.settings import find_study
from study_core.acquisition import heuristic
from study_core.acquisition.pairs import Situation
from study_core.comparison import ComparisonSet
from study_core.domains.driving.domain import DRIVING_V1
from study_core.posterior.run import SamplerSettings, infer
from study_core.study import Study


@pytest.fixture(scope="module")
def study() -> Study:
    return find_study("katz2021")


@pytest.fixture(scope="module")
def comparisons(study: Study) -> ComparisonSet:
    rng = np.random.default_rng(5)
    controls = rng.uniform(-1.0, 1.0, (40, 10))
    values = DRIVING_V1.features(DRIVING_V1.rollout(controls))
    diffs = values[:20] - values[20:]
    return ComparisonSet(diffs, np.where(diffs @ np.array([0.5, 0.3, 0.2, 0.6]) > 0.0, 1.0, -1.0))


def test_the_plain_features_are_those_of_the_domain():
    controls = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 10))
    ours = DRIVING_V1.features(DRIVING_V1.rollout(controls))
    np.testing.assert_allclose([plain.features(row) for row in controls], ours, rtol=0.0, atol=1e-12)


def test_the_plain_log_likelihood_is_that_of_the_response_model(study, comparisons):
    weights = study.prior.draw(np.random.default_rng(2), 20)
    theirs = [
        plain.log_likelihood(row, comparisons.preferred_diffs.tolist(), study.response.rationality)
        for row in weights
    ]
    np.testing.assert_allclose(
        theirs,
        study.response.log_likelihood(weights, study.response.parameters(len(weights)), comparisons),
        rtol=1e-12,
    )


def test_the_plain_prior_is_the_positive_part_of_the_unit_ball():
    assert plain.is_in_the_prior([0.5, 0.5, 0.5, 0.5])
    assert not plain.is_in_the_prior([0.6, 0.5, 0.5, 0.5])
    assert not plain.is_in_the_prior([-0.01, 0.5, 0.5, 0.5])


def test_the_plain_pair_is_the_heuristics_first(study, comparisons):
    posterior = infer(
        np.random.default_rng(3),
        study.prior,
        study.response,
        comparisons,
        SamplerSettings(2, 200, 200, 200, 40),
    )
    situation = Situation(study.domain, posterior, bank=None, mu=0.1, min_difference=0.0)
    ranked = heuristic.rank_pairs(np.random.default_rng(4), situation, 1)
    pair = plain.best_pair(posterior.samples.tolist(), posterior.log_densities.tolist(), 0.1)
    assert np.array_equal(posterior.samples[list(pair)], ranked.weights[0])


def test_the_plain_drive_is_within_the_bounds_and_better_than_its_starts():
    weights = [0.36, 0.2, 0.39, 0.25]
    starts = np.random.default_rng(6).uniform(-1.0, 1.0, (2, 10))
    controls, reward = plain.best_drive(weights, starts)
    assert np.abs(controls).max() <= 1.0
    assert reward == pytest.approx(np.dot(weights, plain.features(controls)), abs=1e-12)
    assert reward > max(np.dot(weights, plain.features(start)) for start in starts)
