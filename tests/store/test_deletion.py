"""A deleted person is gone: from the tables, and from the database's files."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.store import (
    ExternalPerson,
    ImportedSession,
    ModelRecord,
    NewEvent,
    NewReport,
    PosteriorRecord,
    SessionDeletedError,
    Source,
    StoreError,
)

N_QUERIES = 6


def file_of(url):
    return Path(url.removeprefix("sqlite:///"))


def secret(i, what):
    """Something that stands nowhere else."""
    return f"secret-{what}-of-person-{i:03d}"


def somebody(store, i):
    """A person who leaves something in every table."""
    person = ExternalPerson("mine", secret(i, "pid"), {"STUDY_ID": secret(i, "visit")})
    session = store.create_session("hash", secret(i, "token"), Source.JOINED, secret(i, "code"), person)
    store.add_token(session.id, secret(i, "device"))
    for query_index in range(N_QUERIES):
        position = 2 * query_index
        prepared = NewEvent("query_prepared", {"query_index": query_index, "x": secret(i, "query") * 9})
        posterior = PosteriorRecord(
            query_index, np.full(4, i + 0.123), np.full((50, 4), i + 0.456), {"s": secret(i, "summary")}
        )
        store.append(session.id, position, [prepared], posterior)
        answer = NewEvent("answer_given", {"query_index": query_index, "x": secret(i, "answer")})
        report = NewReport(query_index, {"x": secret(i, "measure")})
        store.append(session.id, position + 1, [answer], report=report)
    # Larger than a page, and replaced once.
    for n in range(2):
        content = secret(i, f"model{n}").encode() * 700
        store.put_personal_model(session.id, ModelRecord("network", f"key-{n}", content, {}))
    return session.id


@pytest.fixture
def people(store):
    store.put_study("hash", "mine", "text")
    ids = [somebody(store, i) for i in range(12)]
    for n, first in enumerate((0, 3, 6)):
        content = "".join(secret(i, f"shared{n}") for i in range(first, 12)).encode() * 100
        store.put_shared_model("mine", ModelRecord(f"kind-{n}", "key", content, {}), ids[first:])
    return ids


def traces(url, text):
    """Every file of the database, and the write-ahead log, that holds a text."""
    folder = file_of(url).parent
    return [path.name for path in folder.iterdir() if text in path.read_bytes()]


WHAT = (
    "token",
    "device",
    "code",
    "pid",
    "visit",
    "query",
    "summary",
    "answer",
    "measure",
    "model0",
    "model1",
    "shared0",
)


def test_nothing_of_a_deleted_person_is_left_in_the_files(store, people, database_url):
    for what in WHAT[:-3]:
        assert traces(database_url, secret(4, what).encode()) != []
    done = store.delete_session(people[4])
    assert done.n_answers == N_QUERIES
    assert (done.n_personal_models, done.n_shared_models, done.is_wiped) == (1, 2, True)
    for what in WHAT:
        assert traces(database_url, secret(4, what).encode()) == [], what
    assert traces(database_url, b"of-person-004") == []
    samples = np.full(4, 4 + 0.456).tobytes()
    assert traces(database_url, samples) == []
    # Whoever stays is whole.
    for i in (3, 5):
        assert traces(database_url, secret(i, "answer").encode()) != []
        assert len(store.events(people[i])) == 2 * N_QUERIES
        assert len(store.posteriors(people[i])) == N_QUERIES
    assert store.shared_model("mine", "kind-2") is not None


def test_nothing_is_left_of_half_the_people_deleted_in_turn(store, people, database_url):
    for person in people[::2]:
        store.delete_session(person)
    for i in range(0, 12, 2):
        assert traces(database_url, f"of-person-{i:03d}".encode()) == []
    assert [len(store.events(person)) for person in people[1::2]] == [2 * N_QUERIES] * 6


def test_the_file_is_rewritten_without_the_pages_that_have_become_free(store, people, database_url):
    store.delete_session(people[4])
    with closing(sqlite3.connect(file_of(database_url))) as rows:
        assert rows.execute("PRAGMA freelist_count").fetchone() == (0,)


def test_the_tables_hold_no_row_of_a_deleted_person_but_the_tombstone(store, people, database_url):
    store.delete_session(people[4])
    with closing(sqlite3.connect(file_of(database_url))) as rows:
        tables = [name for (name,) in rows.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        holding = {
            table for table in tables for row in rows.execute(f"SELECT * FROM {table}") if people[4] in row
        }
        assert holding == {"tombstones"}
        ((session_id, at),) = rows.execute("SELECT * FROM tombstones")
    assert session_id == people[4]
    assert at.startswith("20")
    assert people[4] not in [record.id for record in store.sessions()]


@pytest.mark.parametrize(
    "call", ["session", "events", "posteriors", "measures", "n_answers", "delete_session"]
)
def test_a_deleted_session_is_said_to_be_deleted(store, people, call):
    store.delete_session(people[0])
    with pytest.raises(SessionDeletedError, match=r"was deleted at 20.*Nothing is kept"):
        getattr(store, call)(people[0])


def test_what_comes_late_for_a_deleted_session_is_refused(store, people):
    store.delete_session(people[0])
    with pytest.raises(SessionDeletedError):
        store.append(people[0], 2 * N_QUERIES, [NewEvent("query_prepared", {"query_index": N_QUERIES})])
    assert store.session_by_token(secret(0, "token")) is None


def test_an_unknown_session_cannot_be_deleted(store):
    with pytest.raises(StoreError, match="got 'nobody'"):
        store.delete_session("nobody")


def test_while_somebody_reads_an_older_state_the_files_are_said_to_be_not_clean(
    store, people, database_url, monkeypatch
):
    monkeypatch.setattr("app.store.sqlite.BUSY_TIMEOUT_MS", 50)
    store._database._engine.dispose()  # connections made from now on are as impatient
    with closing(sqlite3.connect(file_of(database_url))) as other:
        other.execute("BEGIN")
        other.execute("SELECT count(*) FROM events").fetchone()
        assert not store.delete_session(people[4]).is_wiped
    assert people[4] not in [record.id for record in store.sessions()]


def test_the_database_itself_refuses_to_forget_a_person_that_a_model_remembers(store, people, database_url):
    with closing(sqlite3.connect(file_of(database_url))) as rows:
        rows.execute("PRAGMA foreign_keys = ON")
        with pytest.raises(sqlite3.IntegrityError, match="FOREIGN KEY"):
            rows.execute("DELETE FROM sessions WHERE id = ?", (people[4],))


def test_an_imported_session_is_kept_once_and_whole(store):
    posteriors = tuple(PosteriorRecord(i, np.zeros(2), np.zeros((3, 2))) for i in range(2))
    events = (NewEvent("session_begun"), NewEvent("query_prepared", {"query_index": 0}))
    imported = ImportedSession("da" * 32, "hash", "theirs", "text", events, posteriors)
    record = store.add_imported(imported)
    assert record.source is Source.IMPORTED
    assert store.session(record.id) == record
    assert [event.kind for event in store.events(record.id)] == ["session_begun", "query_prepared"]
    assert [posterior.query_index for posterior in store.posteriors(record.id)] == [0, 1]
    assert store.add_imported(imported) is None
    assert store.add_imported(replace(imported, digest="db" * 32)).ordinal == 2
    assert len(store.sessions_of_study_named("theirs")) == 2


def test_an_imported_session_that_cannot_be_kept_leaves_nothing(store):
    broken = (PosteriorRecord(0, np.zeros(2), np.zeros((3, 3))),)
    with pytest.raises(StoreError, match="mean of shape"):
        store.add_imported(ImportedSession("da" * 32, "hash", "theirs", "text", (NewEvent("x"),), broken))
    assert store.sessions() == []
    with pytest.raises(StoreError, match="Expected a known study"):
        store.study_text("hash")


def test_an_imported_person_may_be_imported_again_once_deleted(store):
    imported = ImportedSession("da" * 32, "hash", "theirs", "text", (NewEvent("session_begun"),), ())
    first = store.add_imported(imported)
    store.delete_session(first.id)
    again = store.add_imported(imported)
    assert again is not None
    assert again.id != first.id


def test_only_the_first_queries_and_their_answers_are_read_as_active(store):
    store.put_study("hash", "mine", "text")
    session_id = somebody(store, 7)
    events = store.active_events(session_id, 2)
    assert [event.payload["query_index"] for event in events] == [0, 0, 1, 1]
    assert store.n_answers(session_id) == N_QUERIES
    assert store.active_events(session_id, N_QUERIES) == store.events(session_id)
