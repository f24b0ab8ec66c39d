"""Backups are whole, and going back to one brings back everything but whoever was deleted since."""

import shutil
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest

from app.store import NewEvent, Role, Source, StoreError, open_existing_store, open_store, serve_lock
from app.store.backup import Contents, back_up, restore


def add_person(store, token, n_events=3):
    session = store.create_session("hash", token, Source.JOINED)
    for position in range(n_events):
        store.append(session.id, position, [NewEvent("something", {"n": position})])
    return session.id


@pytest.fixture
def people(database_url):
    with open_store(database_url) as store:
        store.put_study("hash", "mine", "text")
        return [add_person(store, f"token-{n}") for n in range(3)]


def test_a_backup_holds_everything_and_is_one_file(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    assert back_up(database_url, target) == Contents(n_sessions=3, n_events=9)
    with open_existing_store(f"sqlite:///{target}") as store:
        assert sorted(record.id for record in store.sessions()) == sorted(people)
        assert len(store.events(people[0])) == 3


def test_a_backup_can_be_made_while_answers_come_in(database_url, people, tmp_path):
    is_over = threading.Event()
    with open_store(database_url) as store:

        def answer():
            position = 3
            while not is_over.is_set():
                store.append(
                    people[0], position, [NewEvent("something", {"n": position}), NewEvent("other", {})]
                )
                position += 2

        writer = threading.Thread(target=answer)
        writer.start()
        try:
            copies = [back_up(database_url, tmp_path / f"copy-{n}.db") for n in range(5)]
        finally:
            is_over.set()
            writer.join()
    # Both events of a transaction are in a copy, or neither.
    assert all((copy.n_events - 9) % 2 == 0 for copy in copies)


def test_a_backup_never_overwrites_and_needs_a_database(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    target.write_text("precious")
    with pytest.raises(StoreError, match="never overwrite"):
        back_up(database_url, target)
    assert target.read_text() == "precious"
    with pytest.raises(StoreError, match="found none"):
        back_up(f"sqlite:///{tmp_path / 'nowhere.db'}", tmp_path / "other.db")
    with pytest.raises(StoreError, match="Can't write a backup"):
        back_up(database_url, tmp_path / "no-such-folder" / "copy.db")
    assert not list(tmp_path.glob("*.partial"))


def test_restoring_brings_back_what_was_and_keeps_a_copy_of_what_is(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    back_up(database_url, target)
    with open_store(database_url) as store:
        later = add_person(store, "later")
    done = restore(database_url, target)
    assert (done.contents, done.n_deleted) == (Contents(3, 9), 0)
    with open_store(database_url) as store:
        assert sorted(record.id for record in store.sessions()) == sorted(people)
        assert store.session_by_token("token-1").id == people[1]
        add_person(store, "anew")
    with open_store(f"sqlite:///{done.before}") as before:
        assert later in [record.id for record in before.sessions()]


def test_whoever_was_deleted_since_stays_deleted(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    back_up(database_url, target)
    with open_store(database_url) as store:
        store.delete_session(people[1])
    done = restore(database_url, target)
    assert (done.contents.n_sessions, done.n_deleted) == (2, 1)
    with open_store(database_url) as store:
        assert people[1] not in [record.id for record in store.sessions()]
    # The id stands in its tombstone and that one's index, and nowhere else.
    assert Path(database_url.removeprefix("sqlite:///")).read_bytes().count(people[1].encode()) <= 2


def test_the_desk_stays_as_it_is_now(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    with open_store(database_url) as store:
        for name in ("ann", "bob"):
            store.desk.add_experimenter(name, "hash-1", Role.OWNER)
        token = store.desk.add_api_token("ann", "script", Role.OWNER, "secret")
        store.desk.begin_login("bob", "of bob")
        store.desk.record("ann", "before")
        back_up(database_url, target)
        store.desk.revoke_api_token(token.id)
        store.desk.change_password("ann", "hash-2")
        store.desk.remove_experimenter("bob")
        store.desk.record("ann", "after")
    restore(database_url, target)
    with open_store(database_url) as store:
        assert [one.name for one in store.desk.experimenters()] == ["ann"]
        assert store.desk.password_hash("ann") == "hash-2"
        assert store.desk.program("secret") is None
        assert [entry.action for entry in store.desk.audit()] == ["after", "before"]
        assert len(store.sessions()) == 3


def test_a_backup_is_restored_where_there_is_no_database(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    back_up(database_url, target)
    done = restore(f"sqlite:///{tmp_path / 'fresh.db'}", target)
    assert (done.before, done.contents) == (None, Contents(3, 9))


def spoil(path, n_bytes=4000):
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + n_bytes] = b"\x55" * n_bytes
    path.write_bytes(bytes(content))


def test_what_is_damaged_foreign_newer_or_not_there_changes_nothing(database_url, people, tmp_path):
    good = tmp_path / "good.db"
    back_up(database_url, good)
    damaged, cut, text, foreign, newer = (
        tmp_path / f"{name}.db" for name in ("damaged", "cut", "text", "foreign", "newer")
    )
    shutil.copy(good, damaged)
    spoil(damaged, 20_000)
    cut.write_bytes(good.read_bytes()[:5000])
    text.write_text("hello")
    with closing(sqlite3.connect(foreign)) as rows:
        rows.execute("CREATE TABLE sessions (id)")
        rows.execute("CREATE TABLE events (payload)")
        rows.commit()
    shutil.copy(good, newer)
    with closing(sqlite3.connect(newer)) as rows, rows:
        rows.execute("UPDATE alembic_version SET version_num = '9999'")
    for path in (damaged, cut, text, foreign, newer, tmp_path / "nowhere.db"):
        with pytest.raises(StoreError, match=r"Nothing was changed|found none"):
            restore(database_url, path)
    with open_store(database_url) as store:
        assert sorted(record.id for record in store.sessions()) == sorted(people)
    assert not list(tmp_path.glob(".restoring-*"))


def test_a_database_that_is_served_is_not_replaced(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    back_up(database_url, target)
    with serve_lock(database_url), pytest.raises(StoreError, match="already served"):
        restore(database_url, target)


def test_a_damaged_database_is_replaced_by_its_backup(database_url, people, tmp_path):
    target = tmp_path / "copy.db"
    back_up(database_url, target)
    path = tmp_path / "broken.db"
    path.write_text("this was a database")
    done = restore(f"sqlite:///{path}", target)
    assert done.contents == Contents(3, 9)
    assert done.before.read_text() == "this was a database"
