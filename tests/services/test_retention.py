"""Ids by which others know people are forgotten when their study says so, and that is put down."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest

from app.services.retention import forget_ids
from app.settings import find_study
from app.store import ExternalPerson, NewEvent, Source, Store
from study_core.study import Study, parse_study
from tests.support.command_line import run

QUICKSTART = find_study("quickstart").text
FORGETFUL = parse_study(f"{QUICKSTART}\n[data]\nforget_ids_after_days = 30\n")


def add_person(store: Store, study: Study, external_id: str) -> str:
    store.put_study(study.hash, study.name, study.text)
    person = ExternalPerson(study.name, external_id)
    session = store.create_session(study.hash, external_id, Source.JOINED, person=person)
    store.append(session.id, 0, [NewEvent("session_begun", {"participant": 1})], ending="completed")
    return session.id


def grow_old(database_url: str, session_id: str, days: int) -> None:
    begun = (datetime.now(UTC) - timedelta(days=days)).strftime("%Y-%m-%d %H:%M:%S.%f")
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as rows, rows:
        rows.execute("UPDATE sessions SET created_at = ? WHERE id = ?", (begun, session_id))


@pytest.fixture
def old_and_new(store: Store, database_url: str) -> tuple[str, str]:
    old, new = add_person(store, FORGETFUL, "OLD"), add_person(store, FORGETFUL, "NEW")
    grow_old(database_url, old, 31)
    grow_old(database_url, new, 29)
    return old, new


def test_ids_are_forgotten_after_so_many_days_and_not_before(
    store: Store, old_and_new: tuple[str, str]
) -> None:
    assert forget_ids(store) == {"quickstart": 1}
    assert forget_ids(store) == {}
    old, new = old_and_new
    assert store.external_person(old) is None
    assert store.external_person(new) == ExternalPerson("quickstart", "NEW")
    (entry,) = store.desk.audit()
    assert (entry.who, entry.action, entry.about) == ("retention", "ids_forgotten", "quickstart")
    assert entry.detail == {"n_people": 1, "days": 30}


def test_a_study_that_says_nothing_forgets_nothing(store: Store, database_url: str) -> None:
    grow_old(database_url, add_person(store, parse_study(QUICKSTART), "OLD"), 4000)
    assert forget_ids(store) == {}


def test_the_command_says_what_it_forgot(database_url: str, old_and_new: tuple[str, str]) -> None:
    assert "the ids of 1 people of quickstart" in run("forget", "--database", database_url).stdout
    assert "nothing to forget" in run("forget", "--database", database_url).stdout
