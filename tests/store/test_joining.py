"""What opens a session, who its person is to others, how it ended, and answers that are taken back."""

import sqlite3
import threading
from contextlib import closing
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from app.store import (
    Arm,
    ExternalPerson,
    NewEvent,
    PersonKnownError,
    PositionTakenError,
    PosteriorRecord,
    SessionDeletedError,
    Source,
    TokenTakenError,
    open_store,
)

PERSON = ExternalPerson("mine", "5f-pid", {"STUDY_ID": "a-study", "SESSION_ID": "a-visit"})


@pytest.fixture(autouse=True)
def versions(store):
    """Two versions of one study, and another study."""
    for study_hash, name in (("v1", "mine"), ("v2", "mine"), ("o", "others")):
        store.put_study(study_hash, name, study_hash)


def somebody(store, token, study_hash="v1", person=None, after=None):
    return store.create_session(study_hash, token, Source.JOINED, f"code-of-{token}", person, after)


def test_several_tokens_open_one_session_and_each_has_a_code(store):
    session = somebody(store, "one")
    store.add_token(session.id, "two", "code-of-two")
    store.add_token(session.id, "two", "code-of-two")
    assert [store.session_by_token(token) for token in ("one", "two", "three")] == [session, session, None]
    assert [store.session_by_code(f"code-of-{token}") for token in ("one", "two")] == [session, session]
    assert store.session_by_code("code-of-three") is None


def test_a_token_opens_one_session_only(store):
    first, second = somebody(store, "one"), somebody(store, "two")
    with pytest.raises(TokenTakenError):
        store.add_token(second.id, "one")
    with pytest.raises(TokenTakenError):
        somebody(store, "two")
    assert store.session_by_token("one") == first
    assert [record.ordinal for record in store.sessions()] == [1, 2]


def test_an_external_id_has_one_session_whatever_the_version_of_the_study(store):
    first = somebody(store, "one", person=PERSON)
    with pytest.raises(PersonKnownError):
        somebody(store, "two", "v2", PERSON)
    assert store.session_of_person("mine", "5f-pid") == first
    assert store.session_by_token("two") is None
    assert len(store.sessions()) == 1
    assert store.external_person(first.id) == PERSON


def test_an_external_id_is_somebody_else_in_another_study(store):
    first = somebody(store, "one", person=PERSON)
    other = somebody(store, "two", "o", ExternalPerson("others", "5f-pid"))
    assert store.session_of_person("mine", "5f-pid") == first
    assert store.session_of_person("others", "5f-pid") == other
    assert store.session_of_person("mine", "another") is None


def test_who_begins_again_goes_on_with_the_new_session_alone(store):
    first = somebody(store, "one", person=PERSON)
    second = somebody(store, "two", "v2", PERSON, after=first.id)
    assert store.session_of_person("mine", "5f-pid") == second
    with pytest.raises(PersonKnownError):
        somebody(store, "three", "v2", PERSON, after=first.id)
    assert store.external_person(first.id) == PERSON


def test_of_many_joins_at_once_with_one_external_id_one_makes_a_session(store):
    start, made = threading.Barrier(8), []

    def join(i):
        start.wait(timeout=30)
        try:
            made.append(somebody(store, f"token-{i}", person=PERSON).id)
        except PersonKnownError:
            return

    threads = [threading.Thread(target=join, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert made == [record.id for record in store.sessions()]
    assert len(made) == 1


def test_the_database_itself_refuses_a_second_session_of_an_external_id(store, database_url):
    somebody(store, "one", person=PERSON)
    other = somebody(store, "two")
    second = "INSERT INTO external_people VALUES ('mine', '5f-pid', 0, ?, '{}')"
    with (
        closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as rows,
        pytest.raises(sqlite3.IntegrityError, match="UNIQUE"),
    ):
        rows.execute(second, (other.id,))


def test_deleting_a_person_reaches_the_session_that_had_become_too_old(store):
    first = somebody(store, "one", person=PERSON)
    second = somebody(store, "two", "v2", PERSON, after=first.id)
    stranger = somebody(store, "three")
    store.append(first.id, 0, [NewEvent("answer_given", {"query_index": 0})])
    deleted = store.delete_session(second.id)
    assert (deleted.session_ids, deleted.n_answers) == ((first.id, second.id), 1)
    assert store.sessions() == [stranger]
    for session in (first, second):
        with pytest.raises(SessionDeletedError):
            store.events(session.id)
    assert store.session_of_person("mine", "5f-pid") is None


def test_places_are_taken_by_whoever_has_completed_or_may_still(store):
    now = datetime.now(UTC)
    endings = ["completed", "declined", "screened-out", "failed", "stopped", "timed-out", None]
    for i, ending in enumerate(endings):
        session = somebody(store, f"token-{i}", "v1" if i % 2 else "v2")
        store.append(session.id, 0, [NewEvent("session_begun")], ending=ending)
        assert store.ending(session.id) == ending
    store.create_session("v1", "rehearsed", Source.REHEARSED)
    somebody(store, "elsewhere", "o")
    assert store.arms("mine", now - timedelta(hours=1)) == [Arm(None, n_completed=1, n_under_way=1)]
    assert store.arms("mine", now + timedelta(hours=1)) == [Arm(None, n_completed=1, n_under_way=0)]


def test_a_session_that_goes_on_after_all_has_not_ended(store):
    session = somebody(store, "one")
    store.append(session.id, 0, [NewEvent("answer_given", {"query_index": 0})], ending="completed")
    store.append(session.id, 1, [NewEvent("answer_taken_back", {"query_index": 0})])
    assert store.ending(session.id) is None


def test_a_secret_is_made_once(store, database_url):
    made = store.secret("signing")
    assert len(made) == 32
    with open_store(database_url) as other:
        assert other.secret("signing") == made
        assert other.secret("another") != made


def event(kind, query_index):
    return NewEvent(kind, {"query_index": query_index})


def posterior(query_index, value):
    return PosteriorRecord(query_index, np.full(2, value), np.full((3, 2), value))


@pytest.fixture
def taken_back(store):
    """A session in which the answer to query 1 was taken back when query 2 was on the screen."""
    session = somebody(store, "one")
    store.append(session.id, 0, [event("query_prepared", 0)], posterior(0, 0.0))
    for i in (0, 1):
        events = [event("answer_given", i), event("query_prepared", i + 1)]
        store.append(session.id, 1 + 2 * i, events, posterior(i + 1, float(i + 1)))
    store.append(session.id, 5, [event("answer_taken_back", 1)])
    return session.id


def test_an_answer_taken_back_does_not_count_and_stays_in_the_log(store, taken_back):
    assert store.n_answers(taken_back) == 1
    assert [(entry.kind, entry.payload["query_index"]) for entry in store.events(taken_back)][-3:] == [
        ("answer_given", 1),
        ("query_prepared", 2),
        ("answer_taken_back", 1),
    ]


def test_what_was_believed_because_of_an_answer_taken_back_is_gone(store, taken_back):
    assert [each.query_index for each in store.posteriors(taken_back)] == [0, 1]
    again = [event("answer_given", 1), event("query_prepared", 2)]
    store.append(taken_back, 6, again, posterior(2, 9.0))
    assert [each.mean[0] for each in store.posteriors(taken_back)] == [0.0, 1.0, 9.0]


def test_a_query_prepared_again_takes_the_place_of_its_posterior(store, taken_back):
    store.append(taken_back, 6, [event("query_prepared", 1)], posterior(1, 7.0))
    assert [each.mean[0] for each in store.posteriors(taken_back)] == [0.0, 7.0]


@pytest.mark.parametrize("kind", ["answer_given", "query_prepared"])
def test_after_a_take_back_a_query_is_answered_and_prepared_once_more_and_only_once(store, taken_back, kind):
    store.append(taken_back, 6, [event(kind, 1)])
    with pytest.raises(PositionTakenError, match="until its answer is taken back"):
        store.append(taken_back, 7, [event(kind, 1)])
    store.append(taken_back, 7, [event("answer_taken_back", 1), event(kind, 1)])


def test_a_take_back_and_what_follows_may_come_at_once(store):
    session = somebody(store, "one")
    events = [event("answer_given", 0), event("answer_taken_back", 0), event("answer_given", 0)]
    store.append(session.id, 0, events)
    assert store.n_answers(session.id) == 1


def test_active_events_hold_no_take_back_of_a_test_answer(store, taken_back):
    kinds = [entry.kind for entry in store.active_events(taken_back, 1)]
    assert kinds == ["query_prepared", "answer_given"]
    assert [entry.kind for entry in store.active_events(taken_back, 2)][-1] == "answer_taken_back"
