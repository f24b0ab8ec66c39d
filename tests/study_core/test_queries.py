"""The next query: derived again to the bit, explained, and never two equal trajectories without saying so."""

from dataclasses import fields

import numpy as np
import pytest
from scipy.stats import binomtest

import study_core.study
from study_core import queries
from study_core.acquisition import acquisition_named
from study_core.acquisition.pairs import Situation
from study_core.choice import ResponseParameters
from study_core.comparison import ComparisonSet
from study_core.distinctness import visible_difference, visible_paths
from study_core.domains.driving import DRIVING_V1
from study_core.lbfgs import VERSION as OPTIMISER_VERSION
from study_core.posterior import metropolis
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior
from study_core.queries import infer_posterior, propose_active_query, propose_test_set
from study_core.streams import stream
from study_core.study import parse_study
from tests.study_core import references

STUDY = parse_study(references.study_text())
NONE = Diagnostics(np.ones(4), np.ones(4), np.ones(4), 0.3, 4000)


def some_answers(n):
    rng = np.random.default_rng(n)
    return ComparisonSet(rng.normal(0, 0.1, (n, 4)), rng.choice([-1.0, 1.0], n))


def posterior_of(samples, log_densities=None):
    samples = np.array(samples)
    logs = np.zeros(len(samples)) if log_densities is None else np.array(log_densities)
    return Posterior(
        samples, ResponseParameters.constant(len(samples), 50.0), logs, samples.mean(axis=0), NONE
    )


def same(first, second):
    """Whether two records are equal in every field, arrays bit for bit."""
    return all(
        np.array_equal(getattr(first, field.name), getattr(second, field.name))
        if isinstance(getattr(first, field.name), np.ndarray)
        else getattr(first, field.name) == getattr(second, field.name)
        for field in fields(first)
    )


def same_proposal(first, second):
    return same(first.query, second.query) and same(first.provenance, second.provenance)


def test_the_posterior_of_a_participant_is_derived_again_to_the_bit():
    first, second = (infer_posterior(STUDY, 3, 7, some_answers(7)) for _ in range(2))
    np.testing.assert_array_equal(first.samples, second.samples)
    np.testing.assert_array_equal(first.log_densities, second.log_densities)
    np.testing.assert_array_equal(first.mean, second.mean)


def test_participants_have_streams_of_their_own():
    samples = [
        infer_posterior(STUDY, participant, 7, some_answers(7)).samples for participant in (1, 2, "rehearsal")
    ]
    assert len({array.tobytes() for array in samples}) == 3


def test_a_query_is_derived_again_to_the_bit_without_its_predecessors():
    posterior = infer_posterior(STUDY, 1, 2, some_answers(2))
    first = propose_active_query(STUDY, 1, 2, posterior)
    propose_active_query(STUDY, 1, 0, posterior)
    propose_test_set(STUDY)
    assert same_proposal(propose_active_query(STUDY, 1, 2, posterior), first)


def test_provenance_says_everything_needed_to_derive_the_query_again():
    posterior = infer_posterior(STUDY, 4, 2, some_answers(2))
    proposed = propose_active_query(STUDY, 4, 2, posterior)
    found = proposed.provenance
    method = acquisition_named("heuristic")
    ranked = method.rank_pairs(np.random.default_rng(0), Situation(DRIVING_V1, posterior, None, 0.1, 0.0), 2)
    assert (found.study_hash, found.seed, found.stream, found.method) == (STUDY.hash, 5, (4, 2), "heuristic")
    assert found.versions == ("driving-v1", metropolis.VERSION, OPTIMISER_VERSION, method.version)
    assert (found.score, found.runner_up_score) == (ranked.scores[0], ranked.scores[1])
    assert (found.pairs_tried, found.are_distinct, found.has_converged) == (1, True, (True, True))
    asked = {tuple(found.weights_a), tuple(found.weights_b)}
    assert asked == {tuple(row) for row in ranked.weights[0]}
    assert found.bank_digest is None
    paths = visible_paths(DRIVING_V1, np.stack([proposed.query.controls_a, proposed.query.controls_b]))
    assert found.visible_difference == pytest.approx(float(visible_difference(paths[:1], paths[1:])[0]))


def test_each_trajectory_is_the_best_found_for_its_own_weights():
    posterior = infer_posterior(STUDY, 4, 2, some_answers(2))
    proposed = propose_active_query(STUDY, 4, 2, posterior)
    query, found = proposed.query, proposed.provenance
    for controls, features in ((query.controls_a, query.features_a), (query.controls_b, query.features_b)):
        expected = references.features(references.drive(references.ROBOT_START, controls))
        np.testing.assert_allclose(features, expected, rtol=0, atol=1e-12)
    for weights, own in ((found.weights_a, query.controls_a), (found.weights_b, query.controls_b)):
        _, gradient = DRIVING_V1.reward_and_gradient(own[None], weights[None])
        assert np.abs(np.clip(own + gradient[0], -1, 1) - own).max() < 1e-5


@pytest.mark.statistical
def test_which_of_the_two_is_called_a_is_a_fair_coin():
    study = parse_study(references.study_text(trajectory__starts=1))
    posterior = posterior_of([[0.9, 0.1, 0.3, 0.1], [0.1, 0.9, 0.2, 0.4]])
    a_is_first = [
        np.array_equal(
            propose_active_query(study, participant, index, posterior).provenance.weights_a,
            posterior.samples[0],
        )
        for participant in range(20)
        for index in range(10)
    ]
    assert binomtest(sum(a_is_first), 200).pvalue > 1e-3
    # Neither the participant nor the index alone decides it.
    table = np.array(a_is_first).reshape(20, 10)
    assert table.mean(axis=0).min() > 0.15
    assert table.mean(axis=0).max() < 0.85
    assert len(np.unique(table, axis=0)) >= 5


def in_domain(monkeypatch, domain, **changes):
    monkeypatch.setattr(study_core.study, "domain_named", lambda name: domain)
    return parse_study(references.study_text(domain=domain.id, **changes))


def test_a_pair_with_equal_controls_is_skipped_for_the_next_best(monkeypatch):
    study = in_domain(monkeypatch, references.BangBangDomain())
    # The two likely samples both want to go forwards; only the third wants backwards.
    posterior = posterior_of([[0.9, 0.1], [0.8, 0.2], [0.1, 0.9]], [0.0, 0.0, -50.0])
    found = propose_active_query(study, 1, 0, posterior)
    assert found.provenance.pairs_tried == 2
    assert found.provenance.are_distinct
    assert {*found.query.controls_a, *found.query.controls_b} == {-1.0, 1.0}
    asked = {tuple(found.provenance.weights_a), tuple(found.provenance.weights_b)}
    assert asked == {(0.9, 0.1), (0.1, 0.9)}
    assert found.provenance.score == pytest.approx(0.1 * (2 * 0.8**2) ** 0.5)


def test_equal_trajectories_are_reported_when_every_pair_has_them(monkeypatch):
    study = in_domain(monkeypatch, references.QuadraticDomain([[2.0, -3.0], [2.0, -3.0]], [1.0, 2.0]))
    samples = np.random.default_rng(1).random((8, 2)) + 0.1
    found = propose_active_query(study, 1, 0, posterior_of(samples))
    assert not found.provenance.are_distinct
    assert found.provenance.visible_difference == 0.0
    # The method's ten best, then ten of the prior; none differs more than the first.
    assert (found.provenance.pairs_tried, found.provenance.method) == (20, "heuristic")
    np.testing.assert_array_equal(found.query.controls_a, [1.0, -1.0])
    np.testing.assert_array_equal(found.query.controls_a, found.query.controls_b)
    np.testing.assert_array_equal(found.query.feature_diff, [0.0, 0.0])


def test_where_all_of_the_methods_pairs_look_alike_the_prior_is_asked(monkeypatch):
    study = in_domain(monkeypatch, references.BangBangDomain())
    found = propose_active_query(study, 1, 0, posterior_of([[0.9, 0.1], [0.8, 0.2]])).provenance
    assert found.are_distinct
    assert (found.method, found.score, found.pairs_tried > 1) == ("prior", 0.0, True)


@pytest.mark.parametrize(("bound", "is_shown"), [(1.9, True), (2.1, False)])
def test_a_pair_closer_than_the_studys_bound_is_not_shown(monkeypatch, bound, is_shown):
    """The bar of length 1 slides to +1 or to -1 within two frames: it is 2 apart in one of them, sqrt(2) on average."""
    changes = {"acquisition__min_difference": bound / 2.0**0.5}
    study = in_domain(monkeypatch, references.BangBangDomain(), **changes)
    found = propose_active_query(study, 1, 0, posterior_of([[0.9, 0.1], [0.1, 0.9]])).provenance
    assert found.visible_difference == pytest.approx(2.0**0.5, rel=1e-6)
    assert found.are_distinct is is_shown


def test_a_query_from_the_bank_says_which_bank_and_what_each_drive_is_best_for():
    study = parse_study(
        references.study_text(acquisition__method="information-gain-realistic", trajectory__search="bank")
    )
    posterior = infer_posterior(study, 4, 2, some_answers(2))
    proposed = propose_active_query(study, 4, 2, posterior)
    found, query = proposed.provenance, proposed.query
    assert found.bank_digest == study.bank.digest
    assert found.versions[-1] == acquisition_named("information-gain-realistic").version
    for weights, own in ((found.weights_a, query.controls_a), (found.weights_b, query.controls_b)):
        _, gradient = DRIVING_V1.reward_and_gradient(own[None], weights[None])
        assert np.abs(np.clip(own + gradient[0], -1, 1) - own).max() < 1e-5
    assert same_proposal(propose_active_query(study, 4, 2, posterior), proposed)


def test_a_query_over_free_controls_has_no_weights_that_its_drives_are_best_for():
    study = parse_study(references.study_text(acquisition__method="information-gain"))
    found = propose_active_query(study, 1, 0, infer_posterior(study, 1, 2, some_answers(2))).provenance
    assert (found.weights_a, found.weights_b, found.are_distinct) == (None, None, True)


@pytest.mark.parametrize(("gap", "are_distinct"), [(2.5e-6, True), (1.5e-6, False)])
def test_controls_are_the_same_when_they_differ_by_less_than_a_millionth_of_their_range(
    monkeypatch, gap, are_distinct
):
    domain = references.BangBangDomain()
    # The range is 2, so the limit is 2e-6.
    both = np.array([[0.25], [0.25 + gap]])
    assert queries.differ(domain, both) is are_distinct
    assert queries.differ(domain, both[::-1]) is are_distinct


def test_the_method_that_the_study_names_is_used():
    study = parse_study(references.study_text(acquisition__method="thompson"))
    posterior = infer_posterior(study, 1, 2, some_answers(2))
    found = propose_active_query(study, 1, 2, posterior).provenance
    ranked = acquisition_named("thompson").rank_pairs(
        stream(5, "acquisition", 1, 2), Situation(DRIVING_V1, posterior, None, 0.1, 0.0), 11
    )
    assert (found.method, found.score) == ("thompson", 0.0)
    assert {tuple(found.weights_a), tuple(found.weights_b)} == {tuple(row) for row in ranked.weights[0]}


def test_the_test_set_is_the_same_every_time_and_as_long_as_the_study_says():
    first = propose_test_set(STUDY)
    propose_active_query(STUDY, 9, 0, infer_posterior(STUDY, 9, 0, ComparisonSet.empty(4)))
    second = propose_test_set(parse_study(references.study_text(), source="elsewhere"))
    assert len(first) == len(second) == 2
    assert all(map(same_proposal, first, second))


def test_test_queries_differ_from_each_other_and_are_explained():
    study = parse_study(references.study_text(protocol__test_queries=6))
    test_set = propose_test_set(study)
    assert len({proposed.query.controls_a.tobytes() for proposed in test_set}) == 6
    for index, proposed in enumerate(test_set):
        found = proposed.provenance
        assert (found.method, found.stream, found.are_distinct) == ("test-set", ("test-set", index), True)
        assert np.linalg.norm(found.weights_a) == pytest.approx(1.0)
        assert not np.array_equal(found.weights_a, found.weights_b)


def test_a_longer_test_set_begins_with_the_shorter_one():
    longer = propose_test_set(parse_study(references.study_text(protocol__test_queries=4)))
    for short, long in zip(propose_test_set(STUDY), longer, strict=False):
        assert same(short.query, long.query)


def test_a_study_without_test_queries_has_an_empty_test_set():
    assert propose_test_set(parse_study(references.study_text(protocol__test_queries=0))) == ()


def test_another_seed_is_another_test_set():
    other = propose_test_set(parse_study(references.study_text(seed=6)))
    assert not same(propose_test_set(STUDY)[0].query, other[0].query)
