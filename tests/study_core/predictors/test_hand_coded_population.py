"""What people have in common, as a prior of the utilities of the next; nobody's own answers are in their own."""

import numpy as np
import pytest

from study_core.predictors.hand_coded import HandCodedCalibrated, learn_posterior
from study_core.predictors.hand_coded_population import HandCodedPopulation, learn_population_prior
from study_core.predictors.linear_people import ComparedFeatures
from study_core.predictors.predictor import Pairs, Training
from study_core.streams import stream
from study_core.study import parse_study
from tests.study_core.references import study_text

DOMAIN = parse_study(study_text()).domain
N_STEPS = 50


def person(utilities, seed, n=60):
    """Answers of somebody of known u = beta w to random drives."""
    rng = np.random.default_rng(seed)
    controls = rng.uniform(DOMAIN.control_lower, DOMAIN.control_upper, (2 * n, 10))
    states = DOMAIN.rollout(controls)
    pairs = Pairs(states[:n], states[n:])
    psi = DOMAIN.features(pairs.states_a) - DOMAIN.features(pairs.states_b)
    likes_a = rng.random(n) < 1.0 / (1.0 + np.exp(-psi @ utilities))
    return Training(pairs, np.where(likes_a, 1.0, -1.0))


TASTES = {name: np.array([2.0, 4.0, 12.0, 6.0]) * (0.8 + 0.1 * k) for k, name in enumerate("abcd")}
PEOPLE = {name: person(taste, k) for k, (name, taste) in enumerate(TASTES.items())}


def in_features(people):
    return {name: ComparedFeatures.of(DOMAIN.features, training) for name, training in people.items()}


def test_the_prior_is_around_what_people_have_in_common():
    many = {str(k): person(TASTES["b"], 100 + k, n=100) for k in range(12)}
    prior = learn_population_prior(in_features(many))
    apart = prior.mean - TASTES["b"]
    assert np.sqrt(apart @ prior.precision @ apart) < 4.0
    assert prior.mean @ TASTES["b"] / np.linalg.norm(prior.mean) / np.linalg.norm(TASTES["b"]) > 0.95
    assert np.all(np.linalg.eigvalsh(prior.covariance) > 0.0)


def test_it_is_in_the_features_own_units_whatever_unit_the_people_compared_in():
    prior = learn_population_prior(in_features(PEOPLE))
    backwards = learn_population_prior(in_features(dict(reversed(PEOPLE.items()))))
    np.testing.assert_array_equal(prior.mean, backwards.mean)
    np.testing.assert_array_equal(prior.covariance, backwards.covariance)


def test_nobody_says_nothing():
    nothing = Training(PEOPLE["a"].pairs[:0], np.empty(0))
    assert learn_population_prior({}) is None
    assert learn_population_prior(in_features({"a": nothing})) is None


def test_a_feature_that_never_varied_keeps_mean_nothing_and_a_variance():
    states = PEOPLE["a"].pairs.states_a.copy()
    states[..., 2] = 0.7
    still = Training(Pairs(states, states[::-1]), PEOPLE["a"].signs)
    prior = learn_population_prior(in_features({"a": still}))
    heading = DOMAIN.feature_names.index("heading")
    others = np.delete(np.arange(4), heading)
    assert prior.mean[heading] == pytest.approx(0.0, abs=1e-9)
    assert prior.covariance[heading, heading] > 25.0
    np.testing.assert_allclose(prior.covariance[heading, others], 0.0, atol=1e-6)


def hard_questions(utilities, seed, n=40):
    """Answers of somebody to pairs, among many random ones, that they can't easily tell apart."""
    rng = np.random.default_rng(seed)
    states = DOMAIN.rollout(rng.uniform(DOMAIN.control_lower, DOMAIN.control_upper, (2000, 10)))
    psi = DOMAIN.features(states[:1000]) - DOMAIN.features(states[1000:])
    hard = np.flatnonzero(np.abs(psi @ utilities) < 2.0)
    rows = rng.choice(hard, n, replace=False)
    likes_a = rng.random(n) < 1.0 / (1.0 + np.exp(-psi[rows] @ utilities))
    return Training(Pairs(states[:1000][rows], states[1000:][rows]), np.where(likes_a, 1.0, -1.0))


def test_people_of_whom_only_hard_questions_were_asked_do_not_make_the_next_look_indifferent():
    rng = np.random.default_rng(4)
    tastes = np.abs(rng.normal(size=(7, 4)))
    tastes *= 50.0 / np.linalg.norm(tastes, axis=1, keepdims=True)
    people = {str(k): hard_questions(taste, k) for k, taste in enumerate(tastes[:6])}
    fitted = HandCodedPopulation().fit(3, DOMAIN, people)
    alone = HandCodedCalibrated().fit(3, DOMAIN, people)
    own, test = hard_questions(tastes[6], 50), person(tastes[6], 51, n=300)
    loss = {
        name: -np.log(np.where(test.signs > 0.0, probabilities, 1.0 - probabilities)).mean()
        for name, probabilities in (
            ("with", fitted.with_person(3, own).probability_of_a(test.pairs)),
            ("alone", alone.with_person(3, own).probability_of_a(test.pairs)),
        )
    }
    # Laplace's approximation takes them for a little more indifferent than they are.
    assert loss["with"] < loss["alone"] + 0.1
    assert loss["with"] < 0.5


def test_everybody_starts_from_the_others_alone():
    fitted = HandCodedPopulation().fit(3, DOMAIN, PEOPLE)
    others = {name: training for name, training in PEOPLE.items() if name != "c"}
    rng = stream(3, "hand-coded-population", "person", "c")
    expected = learn_posterior(rng, PEOPLE["c"], DOMAIN, learn_population_prior(in_features(others)))
    np.testing.assert_array_equal(fitted.people["c"].posterior.samples, expected.posterior.samples)


def test_somebody_new_without_answers_is_predicted_by_what_the_others_care_for():
    fitted = HandCodedPopulation().fit(3, DOMAIN, PEOPLE)
    test = person(TASTES["b"], 77, n=200)
    nothing = Training(test.pairs[:0], np.empty(0))
    psi = DOMAIN.features(test.pairs.states_a) - DOMAIN.features(test.pairs.states_b)
    truth = np.sign(psi @ TASTES["b"])
    said = np.sign(fitted.with_person(3, nothing).probability_of_a(test.pairs) - 0.5)
    assert np.mean(said == truth) > 0.85


def test_who_is_alone_starts_from_the_uniform_prior():
    alone = HandCodedPopulation().fit(3, DOMAIN, {"a": PEOPLE["a"]})
    rng = stream(3, "hand-coded-population", "person", "a")
    expected = learn_posterior(rng, PEOPLE["a"], DOMAIN)
    np.testing.assert_array_equal(alone.people["a"].posterior.samples, expected.posterior.samples)
