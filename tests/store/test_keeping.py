"""Studies, sessions, artifacts and browser measures."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest

from app.store import NewEvent, NewReport, PositionTakenError, Source, StoreError


@pytest.fixture
def study(store):
    store.put_study("hash", "Katz 2021", "name = 'katz' # é ∑")
    return "hash"


def test_a_study_text_is_kept_as_it_came(store, study):
    assert store.study_text(study) == "name = 'katz' # é ∑"


def test_putting_a_study_twice_changes_nothing(store, study):
    store.put_study(study, "Another name", "name = 'katz' # é ∑")
    assert store.study_text(study) == "name = 'katz' # é ∑"


def test_another_text_under_the_same_hash_is_refused(store, study):
    with pytest.raises(StoreError, match="different one"):
        store.put_study(study, "Katz 2021", "something else")


def test_an_unknown_study_is_refused(store):
    with pytest.raises(StoreError, match="Expected a known study"):
        store.study_text("nothing")
    with pytest.raises(StoreError, match="Put the study first"):
        store.create_session("nothing", "token", Source.JOINED)


def test_sessions_are_numbered_from_one_within_their_study(store, study):
    store.put_study("other", "Other", "other")
    ordinals = [
        store.create_session(of, f"token-{i}", Source.JOINED).ordinal
        for i, of in enumerate([study, study, "other", study])
    ]
    assert ordinals == [1, 2, 1, 3]


def test_sessions_begun_at_once_get_different_numbers(store, study):
    with ThreadPoolExecutor(8) as people:
        joined = list(
            people.map(lambda i: store.create_session(study, f"token-{i}", Source.JOINED), range(40))
        )
    assert sorted(session.ordinal for session in joined) == list(range(1, 41))
    assert len({session.id for session in joined}) == 40


def test_a_session_is_found_by_its_id_and_by_its_token_hash(store, study):
    created = store.create_session(study, "token-hash", Source.REHEARSED)
    assert store.session(created.id) == created
    assert store.session_by_token("token-hash") == created
    assert store.session_by_token("another") is None
    assert created.source is Source.REHEARSED
    assert created.created_at.utcoffset() == timedelta(0)


def test_a_token_opens_one_session_only(store, study):
    store.create_session(study, "token-hash", Source.JOINED)
    with pytest.raises(StoreError, match="fresh token") as refused:
        store.create_session(study, "token-hash", Source.JOINED)
    assert "token-hash" not in str(refused.value)
    assert len(store.sessions()) == 1


def test_sessions_are_listed_by_study_and_oldest_first(store, study):
    store.put_study("other", "Other", "other")
    created = [
        store.create_session(of, f"token-{i}", Source.JOINED) for i, of in enumerate([study, "other", study])
    ]
    assert store.sessions() == created
    assert store.sessions(study) == [created[0], created[2]]
    assert store.sessions("nothing") == []


def test_an_artifact_comes_back_as_it_was_put_first(store):
    assert store.artifact("key") is None
    store.put_artifact("key", "test_set", b"\x00\xff result")
    store.put_artifact("key", "test_set", b"computed again")
    assert store.artifact("key") == b"\x00\xff result"


def test_artifacts_put_at_once_under_one_key_end_as_one(store):
    with ThreadPoolExecutor(8) as workers:
        list(workers.map(lambda _: store.put_artifact("key", "test_set", b"same"), range(24)))
    assert store.artifact("key") == b"same"


def test_browser_measures_add_up_in_order_and_stay_out_of_the_log(store, study):
    session_id = store.create_session(study, "token", Source.JOINED).id
    begun = [NewEvent("session_begun")]
    store.append(session_id, 0, begun, report=NewReport(4, {"frames_per_second": 59.94, "n_replays": 2}))
    store.append(session_id, 1, begun, report=NewReport(4, {"has_focus": False}))

    kept = store.measures(session_id)
    assert [(report.query_index, report.measures) for report in kept] == [
        (4, {"frames_per_second": 59.94, "n_replays": 2}),
        (4, {"has_focus": False}),
    ]
    assert kept[0].at.utcoffset() == timedelta(0)
    assert [event.payload for event in store.events(session_id)] == [{}, {}]


def test_measures_are_not_kept_where_the_answer_was_not_taken(store, study):
    session_id = store.create_session(study, "token", Source.JOINED).id
    with pytest.raises(PositionTakenError):
        store.append(session_id, 7, [NewEvent("session_begun")], report=NewReport(0, {"n_replays": 1}))
    assert store.measures(session_id) == ()
