"""Opening a database: creating, reopening, refusing, locking; and the settings that make it durable."""

import os
import sqlite3
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from app.store import StoreError, open_store, serve_lock
from app.store.engine import Database, parse_url
from app.store.migrate import head_version, upgrade


def run_sql(url, *statements):
    """Does something to a database behind the store's back."""
    with closing(sqlite3.connect(url.removeprefix("sqlite:///"))) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def assert_refused(url, message):
    """Opening ends in one line that says what was expected, what came and what to do."""
    with pytest.raises(StoreError, match=message) as refused:
        open_store(url)
    assert str(refused.value).startswith("Expected ")
    assert "\n" not in str(refused.value)


def test_an_absent_database_is_created_with_the_newest_schema(database_url):
    with open_store(database_url) as store:
        assert store.schema_version == head_version()
        assert store.sessions() == []


def test_an_empty_file_is_filled(tmp_path):
    path = tmp_path / "empty.db"
    path.touch()
    with open_store(f"sqlite:///{path}") as store:
        assert store.sessions() == []


def test_reopening_keeps_what_was_put(database_url):
    with open_store(database_url) as store:
        store.put_study("hash", "name", "text")
    with open_store(database_url) as store:
        assert store.study_text("hash") == "text"


def test_a_path_with_blanks_percent_signs_and_accents_works(tmp_path):
    folder = tmp_path / "50% é study"
    folder.mkdir()
    open_store(f"sqlite:///{folder / 'a b.db'}").close()
    assert (folder / "a b.db").is_file()


def test_many_may_open_an_absent_database_at_once(database_url):
    with ThreadPoolExecutor(6) as openers:
        stores = list(openers.map(lambda _: open_store(database_url), range(6)))
    for store in stores:
        store.close()


def test_many_processes_may_open_an_absent_database_at_once(database_url):
    code = "import sys; from app.store import open_store; open_store(sys.argv[1]).sessions()"
    openers = [subprocess.Popen([sys.executable, "-c", code, database_url]) for _ in range(4)]
    assert [opener.wait(timeout=60) for opener in openers] == [0, 0, 0, 0]


def test_creating_a_schema_prints_nothing_and_leaves_logging_alone(database_url):
    code = (
        "import logging, sys; from app.store import open_store; logging.basicConfig(level='WARNING'); "
        "before = logging.root.handlers[:]; open_store(sys.argv[1]).close(); "
        "assert logging.root.handlers == before and logging.root.level == logging.WARNING"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, database_url], capture_output=True, text=True, check=True
    )
    assert done.stdout + done.stderr == ""


def test_a_database_of_another_program_is_refused_and_left_as_it_is(database_url, tmp_path):
    run_sql(database_url, "CREATE TABLE recipes (name TEXT)")
    before = (tmp_path / "study.db").read_bytes()
    assert_refused(database_url, "another program's tables")
    assert (tmp_path / "study.db").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["study.db"]


def test_another_program_that_uses_alembic_too_is_refused(database_url):
    run_sql(
        database_url,
        "CREATE TABLE alembic_version (version_num TEXT)",
        "INSERT INTO alembic_version VALUES ('0001')",
    )
    assert_refused(database_url, "another program's tables")


def test_a_newer_schema_is_refused_with_both_versions(database_url):
    open_store(database_url).close()
    run_sql(database_url, "UPDATE alembic_version SET version_num = '9999'")
    assert_refused(
        database_url, f"version {head_version()} .* found 9999, .*newer.* Install the newer prefstudy"
    )
    with pytest.raises(StoreError, match="Install the newer prefstudy"):
        upgrade(database_url)


def test_an_older_schema_is_refused_and_the_migration_named(database_url, monkeypatch):
    open_store(database_url).close()
    monkeypatch.setattr("app.store.migrate.head_version", lambda: "9999")
    assert_refused(database_url, "run `prefstudy migrate`")


def test_a_file_that_is_no_database_is_refused(tmp_path):
    path = tmp_path / "letter.txt"
    path.write_text("Dear experimenter, " * 100)
    assert_refused(f"sqlite:///{path}", "file is not a database")


def test_a_folder_is_refused(tmp_path):
    assert_refused(f"sqlite:///{tmp_path}", "got the folder")


def test_a_missing_folder_is_refused(tmp_path):
    assert_refused(f"sqlite:///{tmp_path / 'nowhere' / 'study.db'}", "Create it first")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder nobody can write to, not even root")
def test_an_unwritable_folder_is_refused():
    assert_refused("sqlite:////proc/study.db", "unable to open database file")


def test_a_read_only_file_is_refused(database_url, monkeypatch):
    open_store(database_url).close()
    # Root may write to any file, so the permission itself is pretended.
    monkeypatch.setattr("app.store.sqlite.os.access", lambda _path, mode: mode != os.W_OK)
    assert_refused(database_url, "read-only")


@pytest.mark.parametrize("url", ["sqlite://", "sqlite:///:memory:", "sqlite:///file:x?mode=memory&uri=true"])
def test_a_database_in_memory_is_refused(url):
    assert_refused(url, "outlive")


@pytest.mark.parametrize("url", ["study.db", "", "http://x/y"])
def test_what_is_no_database_url_is_refused(url):
    assert_refused(url, "Expected a database URL")


def test_a_driver_that_the_store_does_not_speak_is_refused():
    assert_refused("sqlite+aiosqlite:///study.db", "sqlite\\+aiosqlite")


def test_a_password_is_not_in_the_message():
    with pytest.raises(StoreError) as refused:
        open_store("postgresql+psycopg://me:secret@127.0.0.1:1/study")
    assert "secret" not in str(refused.value)


def test_a_closed_store_is_refused(database_url):
    store = open_store(database_url)
    store.close()
    with pytest.raises(StoreError, match="closed"):
        store.sessions()


def test_a_commit_is_on_the_disk_before_it_returns(store, database_url):
    database = Database(parse_url(database_url))
    with database.reading() as rows:
        connection = rows.connection()
        settings = {
            name: connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout", "secure_delete")
        }
    database.close()
    assert settings == {
        "journal_mode": "wal",
        "synchronous": 2,
        "foreign_keys": 1,
        "busy_timeout": 30_000,
        "secure_delete": 1,
    }


def test_a_database_is_served_once(database_url):
    with (
        serve_lock(database_url),
        pytest.raises(StoreError, match=f"already served by process {os.getpid()}; stop it or use another"),
        serve_lock(database_url),
    ):
        pass
    with serve_lock(database_url):
        pass


def test_a_database_is_served_once_under_any_spelling_of_its_path(database_url, tmp_path):
    (tmp_path / "link").symlink_to(tmp_path)
    with (
        serve_lock(database_url),
        pytest.raises(StoreError, match="already served"),
        serve_lock(f"sqlite:///{tmp_path / 'link' / 'study.db'}"),
    ):
        pass


def test_a_dead_server_lets_go_of_its_database(database_url):
    code = (
        "import os, sys; from app.store import serve_lock; serve_lock(sys.argv[1]).__enter__(); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, database_url], check=False)
    with serve_lock(database_url):
        pass


def test_others_may_write_while_a_database_is_served(database_url):
    with serve_lock(database_url), open_store(database_url) as store:
        store.put_study("hash", "name", "text")


def test_a_served_database_is_not_migrated(database_url):
    with serve_lock(database_url), pytest.raises(StoreError, match="already served"):
        upgrade(database_url)
    assert upgrade(database_url).after == head_version()


def test_a_database_that_another_program_keeps_locked_is_refused_in_the_end(store, database_url, monkeypatch):
    monkeypatch.setattr("app.store.sqlite.BUSY_TIMEOUT_MS", 50)
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as other:
        other.execute("BEGIN IMMEDIATE")
        assert_refused(database_url, "database is locked")
    open_store(database_url).close()
