"""A published person becomes a log that says what their files say."""

import hashlib

import numpy as np
import pytest

from app.settings import find_study
from study_core.comparison import Choice
from study_core.domains.driving import DRIVING_V1
from study_core.errors import PublishedDataError
from study_core.events import AnswerGiven, QueryPrepared, SessionBegun
from study_core.plan import Phase
from study_core.published import find_files, read_person
from study_core.published_session import read_session
from study_core.queries import Imported
from study_core.session import Action, next_action, reduce
from tests.support.published import write_person

PROTOCOL = find_study("katz2021-code")


def session_of(folder, number):
    return read_session(*find_files(folder)[number], PROTOCOL, "0.1.0")


def test_the_log_is_that_of_a_finished_session(tmp_path):
    content = write_person(tmp_path, 5)
    session = session_of(tmp_path, 5)
    state = reduce(session.study, session.events)
    assert next_action(session.study, state) is Action.FINISHED
    assert isinstance(session.events[0], SessionBegun)
    assert state.participant == "published-5"
    assert [query.phase for query in state.prepared] == [Phase.ACTIVE] * 6 + [Phase.TEST] * 3
    np.testing.assert_array_equal(state.comparisons.signs, content["active_signs"])
    np.testing.assert_allclose(state.comparisons.feature_diffs, content["active_diffs"], rtol=0, atol=1e-12)


def test_every_drive_and_answer_is_the_files(tmp_path):
    content = write_person(tmp_path, 5)
    events = session_of(tmp_path, 5).events
    queries = [event.proposed.query for event in events if isinstance(event, QueryPrepared)]
    for letter, side in (("a", 0), ("b", 1)):
        expected = np.concatenate([content["active_states"], content["test_states"]])[:, side]
        controls = np.array([getattr(query, f"controls_{letter}") for query in queries])
        np.testing.assert_allclose(DRIVING_V1.rollout(controls), expected, rtol=0, atol=1e-9)
    signs = np.concatenate([content["active_signs"], content["test_signs"]])
    answers = [event for event in events if isinstance(event, AnswerGiven)]
    assert [given.choice for given in answers] == [Choice.A if sign == 1 else Choice.B for sign in signs]
    assert {given.response_time_ms for given in answers} == {None}


def test_every_query_says_from_which_file_it_comes(tmp_path):
    write_person(tmp_path, 5)
    events = session_of(tmp_path, 5).events
    found = [event.proposed.provenance for event in events if isinstance(event, QueryPrepared)]
    expected = []
    for name, n in (("train5.jld2", 6), ("test5.jld2", 3)):
        digest = hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
        expected += [Imported(name, digest, entry) for entry in range(n)]
    assert found == expected


def test_the_study_is_the_published_codes_with_the_numbers_of_queries_answered(tmp_path):
    write_person(tmp_path, 5, n_active=4, n_test=2)
    study = session_of(tmp_path, 5).study
    ours, theirs = (one.file.model_dump() for one in (study, PROTOCOL))
    assert ours.pop("name") == "katz2021-published"
    assert ours.pop("protocol") == {"active_queries": 4, "test_queries": 2, "repeats": 0, "checks": 0}
    theirs.pop("name")
    theirs.pop("protocol")
    assert ours == theirs


@pytest.mark.parametrize("n_extra", [0, 1])
def test_samples_belong_to_the_query_that_was_chosen_from_them(tmp_path, n_extra):
    content = write_person(tmp_path, 5, n_samples=6 + n_extra)
    kept = session_of(tmp_path, 5).posterior_samples
    assert list(kept) == list(range(6))
    for query_index, samples in kept.items():
        np.testing.assert_array_equal(samples, content["samples"][query_index + n_extra])


@pytest.mark.parametrize("n_samples", [5, 8])
def test_another_number_of_samples_is_refused(tmp_path, n_samples):
    write_person(tmp_path, 5, n_samples=n_samples)
    with pytest.raises(PublishedDataError, match=rf"expected 6 or 7 sets of samples .* got {n_samples}"):
        session_of(tmp_path, 5)


def test_a_drive_of_other_dynamics_is_refused(tmp_path):
    write_person(tmp_path, 5, nudge=1e-6)
    with pytest.raises(
        PublishedDataError, match=r"train5\.jld2: Expected states .* drive 0 of 12"
    ) as refused:
        session_of(tmp_path, 5)
    assert "\n" not in str(refused.value)


def test_the_same_content_has_the_same_digest_under_another_name(tmp_path):
    digests = []
    for name in ("train{}.jld2", "train{}jld2"):
        folder = tmp_path / name
        folder.mkdir()
        write_person(folder, 10, training_name=name)
        digests.append(session_of(folder, 10).digest)
    write_person(tmp_path, 11)
    assert digests[0] == digests[1] != session_of(tmp_path, 11).digest


def test_published_drives_come_back_from_their_controls(published_directory):
    number, files = next(iter(find_files(published_directory).items()))
    person, session = read_person(*files), session_of(published_directory, number)
    queries = [event.proposed.query for event in session.events if isinstance(event, QueryPrepared)]
    stored = np.concatenate([person.training_states, person.test_states])
    for letter, side in (("a", 0), ("b", 1)):
        controls = np.array([getattr(query, f"controls_{letter}") for query in queries])
        np.testing.assert_allclose(DRIVING_V1.rollout(controls), stored[:, side], rtol=0, atol=1e-9)


@pytest.mark.parametrize("number", [1, 3, 15])
def test_published_queries_are_best_for_two_of_the_samples_they_are_said_to_come_from(
    published_directory, number
):
    files = find_files(published_directory)
    if number not in files:
        pytest.skip(f"the files of person {number} are not here")
    session = session_of(published_directory, number)
    queries = [event.proposed.query for event in session.events if isinstance(event, QueryPrepared)]
    for query_index in (0, 10, 40, 70):
        for controls in (queries[query_index].controls_a, queries[query_index].controls_b):
            slopes = [
                steepest_ascent(controls, session.posterior_samples[index])
                for index in (query_index, query_index + 1)
            ]
            # Their optimiser ended at a slope of 1e-8; for a sample of any other update it is a thousandth.
            assert slopes[0] < 1e-5 < slopes[1]


def steepest_ascent(controls, samples):
    """The largest slope within the bounds, for the sample that makes it smallest."""
    _, slopes = DRIVING_V1.reward_and_gradient(np.repeat(controls[None], len(samples), axis=0), samples)
    is_held = ((controls > 1 - 1e-6) & (slopes > 0)) | ((controls < -1 + 1e-6) & (slopes < 0))
    return np.abs(np.where(is_held, 0.0, slopes)).max(axis=1).min()
