"""What was honestly computed is verified; one number that was changed is found and named."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

from study_core.comparison import Choice, Query
from study_core.plan import Phase
from study_core.posterior.population import PopulationPrior
from study_core.verification.session import Verifier
from tests.study_core import references
from tests.study_core.verification.walked import small_study, walk

INFERRED = {"response__rationality": "inferred", "response__lapse_rate": "inferred"}
METHODS = (
    *("heuristic", "heuristic-relative", "information-gain", "information-gain-realistic"),
    *("volume-removal", "regret", "thompson", "random"),
)


def mixed(**changes):
    protocol = {"protocol__active_queries": 5, "protocol__repeats": 2, "protocol__checks": 1}
    return small_study(**(protocol | changes))


@pytest.fixture(scope="module")
def walked():
    """Six steps of every kind, by the paper's heuristic."""
    return walk(mixed())


@pytest.mark.parametrize("method", METHODS)
def test_what_was_honestly_computed_is_verified(method):
    session = walk(mixed(acquisition__method=method, **INFERRED))
    found = session.verified()
    assert not found.violations, found.violations[0]
    assert found.n_compared > 1000
    climbs = {"information-gain", "volume-removal"}
    assert set(found.left_out) <= (
        {"drives of searches that had not converged"} if method in climbs else set()
    )


@pytest.mark.parametrize("method", ["heuristic", "information-gain", "information-gain-realistic"])
@pytest.mark.parametrize("least", [1.0, 50.0])
def test_pairs_that_look_alike_are_passed_over_and_verified_all_the_same(method, least):
    session = walk(small_study(acquisition__method=method, acquisition__min_difference=least))
    found = session.verified()
    assert not found.violations, found.violations[0]
    provenances = [event.proposed.provenance for event in session.queries.values()]
    assert any(each.pairs_tried > 1 for each in provenances)
    if least == 50.0:
        assert not any(each.are_distinct for each in provenances)
        assert {each.pairs_tried for each in provenances} == {10, 20}


@pytest.mark.parametrize("method", METHODS)
def test_another_score_or_drive_is_found_whatever_the_method(method):
    session = walk(small_study(acquisition__method=method))
    index = [i for i, event in session.queries.items() if event.phase is Phase.ACTIVE][-1]
    found = session.with_query(index, changed_provenance(score=lambda old: old + 1e-6)).verified()
    assert [(each.query_index, each.quantity) for each in found.violations][:1] == [
        (index, "provenance.score")
    ]
    elsewhere = session.queries[0].proposed.query
    assert session.queries[index].phase is Phase.ACTIVE

    def other(event):
        query = replace(
            event.proposed.query, controls_a=elsewhere.controls_a, features_a=elsewhere.features_a
        )
        return replace(event, proposed=replace(event.proposed, query=query))

    assert session.with_query(index, other).verified().violations


def test_a_search_from_the_bank_and_what_the_evidence_chose_are_verified():
    evidence = {"response__rationality": "evidence", "trajectory__search": "bank"}
    session = walk(small_study(protocol__active_queries=2, protocol__test_queries=1, **evidence))
    assert not session.verified().violations
    parameters = session.posteriors[1].parameters
    odd = replace(parameters, rationality=np.full(len(parameters), 1000.0))
    found = session.with_posterior(1, parameters=odd).verified()
    assert any("log evidence" in each.quantity for each in found.violations)
    between = replace(parameters, rationality=np.full(len(parameters), 51.0))
    found = session.with_posterior(1, parameters=between).verified()
    assert ("rationality", 51.0) in [(each.quantity, each.stored) for each in found.violations]


def test_a_start_from_the_people_before_is_verified():
    population = PopulationPrior(np.array([10.0, 20.0, 10.0, 30.0]), np.diag([30.0, 60.0, 40.0, 90.0]))
    study = small_study(**INFERRED)
    session = walk(study, population=population)
    assert not session.verified().violations
    without = replace(session, log=session.log[:1] + session.log[2:])
    assert any("mean" in each.quantity for each in without.verified().violations)


def changed_query(field, place=None, by=1e-6):
    """Takes a query; gives it with one of its numbers changed."""

    def change(event):
        query = event.proposed.query
        value = getattr(query, field).copy()
        value[place] += by
        return replace(event, proposed=replace(event.proposed, query=replace(query, **{field: value})))

    return change


def changed_provenance(**changes):
    def change(event):
        old = event.proposed.provenance
        new = {name: to(getattr(old, name)) if callable(to) else to for name, to in changes.items()}
        return replace(event, proposed=replace(event.proposed, provenance=replace(old, **new)))

    return change


def moved(place, by):
    def move(values):
        values = values.copy()
        values[place] += by
        return values

    return move


CHANGES = {
    "query.features_b[2]": changed_query("features_b", 2),
    "query.features_a": changed_query("controls_a", 3, 1e-4),
    "query.controls_b": changed_query("controls_b", 1, 10.0),
    "provenance.score": changed_provenance(score=lambda old: old + 1e-6),
    "provenance.runner_up_score": changed_provenance(runner_up_score=lambda old: old - 1e-6),
    "provenance.weights_a": changed_provenance(weights_a=moved(0, 1e-6)),
    "provenance.seed": changed_provenance(seed=6),
    "provenance.stream[1]": changed_provenance(stream=(1, 77)),
    "provenance.study_hash": changed_provenance(study_hash="0f" * 32),
    "provenance.versions[1]": changed_provenance(versions=lambda old: (old[0], "sampler-0", *old[2:])),
    "provenance.method": changed_provenance(method="thompson"),
    "provenance.are_distinct": changed_provenance(are_distinct=False),
    "provenance.visible_difference": changed_provenance(visible_difference=lambda old: old + 0.01),
    "first_shown": lambda event: replace(
        event, first_shown=Choice.A if event.first_shown is Choice.B else Choice.B
    ),
    "repeat_of": lambda event: replace(event, repeat_of=0),
}


@pytest.mark.parametrize("quantity", CHANGES)
def test_a_change_of_a_chosen_query_is_named(walked, quantity):
    index = next(i for i, event in walked.queries.items() if i > 0 and event.phase is Phase.ACTIVE)
    found = walked.with_query(index, CHANGES[quantity]).verified()
    named = [each for each in found.violations if each.quantity.startswith(quantity)]
    assert named, found.violations
    assert named[0].query_index == index
    assert named[0].stored != named[0].recomputed


@pytest.mark.parametrize("phase", [Phase.CHECK, Phase.REPEAT, Phase.TEST])
@pytest.mark.parametrize("field", ["features_b", "controls_a"])
def test_a_change_of_any_other_query_is_found(walked, phase, field):
    index = next(i for i, event in walked.queries.items() if event.phase is phase)
    found = walked.with_query(index, changed_query(field, 2, 1e-5)).verified()
    assert {each.query_index for each in found.violations} == {index}


def best_drive(weights, start):
    """An optimum next to a start, by another optimiser and another reward."""

    def fall(controls):
        point = torch.tensor(controls, requires_grad=True)
        reward = references.torch_reward(point, torch.tensor(weights))
        reward.backward()
        return -reward.item(), -point.grad.numpy()

    bounds = list(zip(DOMAIN.control_lower, DOMAIN.control_upper, strict=True))
    return minimize(fall, start, jac=True, method="SLSQP", bounds=bounds, options={"ftol": 1e-14}).x


DOMAIN = small_study().domain


def test_the_second_best_pair_with_the_best_drives_and_scores_of_its_own_is_found(walked):
    index = next(i for i, event in walked.queries.items() if i > 0 and event.phase is Phase.ACTIVE)
    event, samples = walked.queries[index], walked.posteriors[index].samples
    order = np.random.default_rng(0).permutation(len(samples))[:2]
    weights = samples[order]
    controls = [best_drive(w, np.zeros(10)) for w in weights]
    features = [references.features(references.drive(references.ROBOT_START, each)) for each in controls]
    query = Query(*controls, *map(np.array, features))

    def other(old):
        provenance = replace(old.proposed.provenance, weights_a=weights[0], weights_b=weights[1])
        return replace(old, proposed=replace(old.proposed, query=query, provenance=provenance))

    assert event.proposed.provenance.pairs_tried == 1
    found = walked.with_query(index, other).verified()
    assert any(each.quantity.startswith("provenance.weights") for each in found.violations)


def brute_force(samples, answers, mu=0.1):
    """Every pair of samples with the paper's objective, from the equations, best first."""
    likelihoods = np.zeros(len(samples))
    if len(answers):
        diffs = np.array([query.feature_diff for query, _ in answers])
        signs = np.array([choice.sign for _, choice in answers])
        likelihoods = references.log_likelihoods(diffs, signs, samples, 50.0, 0.1)
    scored = []
    for i in range(len(samples)):
        for j in range(i):
            apart = np.sqrt(((samples[i] - samples[j]) ** 2).sum())
            scored.append((float(np.exp(likelihoods[i]) * np.exp(likelihoods[j]) + mu * apart), i, j))
    return sorted(scored, reverse=True)


def test_what_is_verified_is_the_best_pair_by_brute_force_and_the_second_best_is_not(walked):
    given = {event.query_index: event.choice for event in walked.log if hasattr(event, "choice")}
    active = [i for i, event in walked.queries.items() if event.phase is Phase.ACTIVE]
    for n_before, index in enumerate(active):
        provenance = walked.queries[index].proposed.provenance
        answers = [(walked.queries[i].proposed.query, given[i]) for i in active[:n_before]]
        samples = walked.posteriors[index].samples
        (score, i, j), (following, k, m), *others = brute_force(samples, answers)
        assert (provenance.pairs_tried, provenance.score) == (1, pytest.approx(score, rel=1e-12))
        assert provenance.runner_up_score == pytest.approx(following, rel=1e-12)
        assert {provenance.weights_a.tobytes(), provenance.weights_b.tobytes()} == {
            samples[i].tobytes(),
            samples[j].tobytes(),
        }
        second = changed_provenance(
            weights_a=samples[k], weights_b=samples[m], score=following, runner_up_score=others[0][0]
        )
        named = {each.quantity for each in walked.with_query(index, second).verified().violations}
        assert {"provenance.score", "provenance.runner_up_score"} <= named


def test_features_and_controls_that_were_changed_together_are_no_optimum_any_more(walked):
    index = next(i for i, event in walked.queries.items() if event.phase is Phase.TEST)

    def drive_worse(event):
        controls = event.proposed.query.controls_a.copy()
        inward = -np.sign(controls[2]) or 1.0
        controls[2] += 0.02 * inward
        features = np.array(references.features(references.drive(references.ROBOT_START, controls)))
        query = replace(event.proposed.query, controls_a=controls, features_a=features)
        return replace(event, proposed=replace(event.proposed, query=query))

    found = walked.with_query(index, drive_worse).verified()
    assert "reward of trajectory A" in [each.quantity for each in found.violations]
    assert not any(each.quantity.startswith("query.features") for each in found.violations)


@pytest.mark.parametrize("method", ["heuristic", "information-gain-realistic", "information-gain", "regret"])
def test_another_answer_is_found_in_what_follows(method):
    session = walk(mixed(acquisition__method=method, protocol__active_queries=4))
    first = next(i for i, event in session.queries.items() if event.phase is Phase.ACTIVE)
    given = next(
        e.choice for e in session.log if getattr(e, "query_index", None) == first and hasattr(e, "choice")
    )
    other = Choice.A if given is Choice.B else Choice.B
    found = session.with_answer(first, other).verified()
    assert found.violations
    assert all(each.query_index > first for each in found.violations)


def test_a_changed_sample_or_mean_is_found(walked):
    index, stored = next(iter(walked.posteriors.items()))
    samples = stored.samples.copy()
    samples[7, 1] += 1e-6
    found = walked.with_posterior(index, samples=samples).verified()
    assert any("length of sample[7]" in each.quantity for each in found.violations)
    errors = stored.samples.std(axis=0) / np.sqrt(stored.diagnostics.ess_bulk[:4])
    mean = stored.mean.copy()
    mean[1] += 15.0 * errors[1]
    found = walked.with_posterior(index, mean=mean).verified()
    (violation,) = found.violations
    assert (violation.query_index, violation.quantity) == (index, "mean[1]")
    assert violation.stored == mean[1]
    missing = walked.with_posterior(index, samples=stored.samples[1:]).verified()
    assert any(each.quantity == "number of samples" for each in missing.violations)


def test_parameters_that_the_study_fixes_and_those_nobody_kept(walked):
    index, stored = list(walked.posteriors.items())[2]
    rationality = stored.parameters.rationality + 1.0
    odd = replace(stored.parameters, rationality=rationality)
    found = walked.with_posterior(index, parameters=odd).verified()
    assert any(each.quantity.startswith("rationality[0]") for each in found.violations)
    found = walked.with_posterior(index, parameters=None).verified()
    assert not found.violations
    assert found.left_out == {"choices by response parameters that nobody kept": 1}


def test_the_test_set_is_everybodys_and_looked_at_once(walked):
    verifier, other = Verifier(walked.study), walk(walked.study, participant=2)
    first, second = walked.verified(verifier), other.verified(verifier)
    assert not first.violations
    assert not second.violations
    assert second.n_compared < first.n_compared
    index = next(i for i, event in other.queries.items() if event.phase is Phase.TEST)
    changed = other.with_query(index, changed_provenance(visible_difference=lambda old: old + 1e-7))
    (violation,) = changed.verified(verifier).violations
    assert violation.quantity == "provenance.visible_difference"


@pytest.mark.slow
def test_a_learned_feature_is_verified_but_for_its_training():
    learning = {"learning__feature_every": 15, "acquisition__method": "information-gain-realistic"}
    online = {"protocol__active_queries": 16, "protocol__test_queries": 1, "trajectory__search": "bank"}
    session = walk(small_study(**INFERRED, **learning, **online))
    found = session.verified()
    assert not found.violations, found.violations[0]
    assert found.left_out == {"trainings of a learned feature": 1}
    (learned,) = [event for event in session.log if hasattr(event, "feature")]

    def named(**changes):
        other = replace(learned, feature=replace(learned.feature, **changes))
        log = tuple(other if event is learned else event for event in session.log)
        return {each.quantity.split("[")[0] for each in replace(session, log=log).verified().violations}

    drives = learned.feature.drives.copy()
    drives[0, 2] *= 0.5
    assert "reward of feature.drives" in named(drives=drives)
    assert "feature.drive_weights" in named(drive_weights=learned.feature.drive_weights + 1e-6)
    assert "feature.n_learned_from" in named(n_learned_from=3)
    lineage = dataclasses.replace(learned.feature.checkpoint.lineage, answers_digest="00")
    checkpoint = replace(learned.feature.checkpoint, lineage=lineage)
    assert "feature.answers_digest" in named(checkpoint=checkpoint)
    networks = learned.feature.checkpoint.networks
    larger = replace(networks, linear_weights=networks.linear_weights * np.float32(1.01))
    checkpoint = replace(learned.feature.checkpoint, networks=larger)
    assert "spread of the feature" in named(checkpoint=checkpoint)
