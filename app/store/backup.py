"""Copies of a database, and going back to one: a copy is read back before it counts."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from sqlalchemy import URL

from app.store import sqlite
from app.store.engine import parse_url
from app.store.errors import SessionDeletedError, StoreError
from app.store.locking import serve_lock
from app.store.migrate import SchemaState, migration_transaction, schema_state, upgrade
from app.store.store import open_existing_store

_SIDE_FILES = ("-wal", "-shm")
# Those that others point to come first.
_OF_THE_DESK = ("experimenters", "api_tokens", "audit")


@dataclass(frozen=True)
class Contents:
    """How much is in a database.

    Attributes:
        n_sessions: Sessions.
        n_events: Entries of their logs.
    """

    n_sessions: int
    n_events: int


@dataclass(frozen=True)
class Restored:
    """What `restore` has done.

    Attributes:
        contents: What the database holds now.
        n_deleted: How many people of the backup had been deleted since, and are so again.
        before: Copy of the database as it was; None where there was none.
    """

    contents: Contents
    n_deleted: int
    before: Path | None


def back_up(url: str, target: Path) -> Contents:
    """Copies a database, also one that is being served, to a new file, and reads the copy back.

    Args:
        url: The database's URL.
        target: A file that doesn't exist.

    Returns:
        What the copy holds.

    Raises:
        StoreError: When there is no such database, it is no SQLite file, or the copy can't be made or isn't whole.
    """
    source = _sqlite_file(url)
    with open_existing_store(url):
        pass
    _refuse_existing(target)
    partial = target.with_name(f"{target.name}.partial")
    try:
        with closing(sqlite3.connect(source)) as original, closing(sqlite3.connect(partial)) as copy:
            original.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")
        contents = _checked(partial)
        partial.replace(target)
    except (OSError, sqlite3.Error) as error:
        raise StoreError(
            f"Can't write a backup to {target}: {error}. Name a file where there is room."
        ) from error
    finally:
        partial.unlink(missing_ok=True)
    return contents


def restore(url: str, backup: Path) -> Restored:
    """Puts a backup in the place of a database, which nobody may be serving; a copy of that is kept.

    Whoever has been deleted since the backup was made stays deleted. Experimenters, their tokens and the audit stay as
    they are now. A backup of an older schema is upgraded.

    Args:
        url: The database's URL; need not exist.
        backup: What `back_up` has made.

    Raises:
        StoreError: When the database is being served, or the backup is damaged, another program's or newer. Nothing
            was changed.
    """
    database = _sqlite_file(url)
    if not backup.is_file():
        raise StoreError(
            f"Expected a backup at {backup}, found none. Name a file that `prefstudy backup` made."
        )
    with serve_lock(url), _copy_of(backup, database.parent) as copy:
        n_deleted = _delete_again(copy, _tombstones(database))
        _keep_the_desk(copy, database)
        contents = _checked(copy)
        before = _kept(database) if database.exists() else None
        for suffix in _SIDE_FILES:
            database.with_name(database.name + suffix).unlink(missing_ok=True)
        copy.replace(database)
    return Restored(contents, n_deleted, before)


def _kept(database: Path) -> Path:
    """Copies the database that is replaced, byte for byte if it can't be read any more."""
    try:
        _checked(database)
    except StoreError:
        kept = sqlite.name_of_copy(database, "damaged")
        shutil.copyfile(database, kept)
        return kept
    return sqlite.back_up(database, "before-restore")


@contextmanager
def _copy_of(backup: Path, folder: Path) -> Iterator[Path]:
    """Gives a copy of a backup with this version's schema, on the same disk as the database."""
    with TemporaryDirectory(dir=folder, prefix=".restoring-") as scratch:
        copy = Path(scratch) / "database.db"
        try:
            with (
                closing(sqlite3.connect(f"{backup.absolute().as_uri()}?mode=ro", uri=True)) as original,
                closing(sqlite3.connect(copy)) as target,
            ):
                original.backup(target)
        except sqlite3.Error as error:
            raise _no_backup(backup, str(error)) from error
        _checked(copy, named=backup)
        url = URL.create("sqlite", database=str(copy))
        with migration_transaction(url) as connection:
            state = schema_state(connection)
        if state not in (SchemaState.CURRENT, SchemaState.OLDER):
            raise _no_backup(backup, f"what stands in it is {state.value}")
        upgrade(str(url))
        yield copy


def _delete_again(copy: Path, session_ids: list[str]) -> int:
    n_deleted = 0
    with open_existing_store(f"sqlite:///{copy}") as store:
        known = {record.id for record in store.sessions()}
        for session_id in session_ids:
            if session_id in known:
                try:
                    store.delete_session(session_id)
                except SessionDeletedError:
                    # It went with another session of the same person.
                    continue
                n_deleted += 1
    with closing(sqlite3.connect(copy)) as rows:
        rows.execute("PRAGMA journal_mode = DELETE")
    return n_deleted


def _keep_the_desk(copy: Path, database: Path) -> None:
    """Keeps who may use the desk, and what they did, as it is: no lost right comes back, and no trace is lost.

    Where the database can't be read, or has another schema, what the backup says of them holds.
    """
    if not database.exists():
        return
    with closing(sqlite3.connect(copy)) as rows, suppress(sqlite3.Error):
        rows.execute("ATTACH DATABASE ? AS now", (str(database),))
        with rows:
            # Whoever is logged in logs in again.
            rows.execute("DELETE FROM main.desk_sessions")
            for table in _OF_THE_DESK:
                rows.execute(f"DELETE FROM main.{table}")
                rows.execute(f"INSERT INTO main.{table} SELECT * FROM now.{table}")


def _tombstones(database: Path) -> list[str]:
    """Returns who has been deleted from a database; nobody where there is none or it can't be read."""
    if not database.exists():
        return []
    try:
        with closing(sqlite3.connect(database)) as rows:
            return [row[0] for row in rows.execute("SELECT session_id FROM tombstones ORDER BY deleted_at")]
    except sqlite3.Error:
        # A damaged database is what backups are for.
        return []


def _checked(path: Path, named: Path | None = None) -> Contents:
    """Reads a copy back: every page of it, and every row of the logs."""
    try:
        with closing(sqlite3.connect(path)) as rows:
            (verdict,) = rows.execute("PRAGMA integrity_check").fetchone()
            if verdict != "ok":
                raise _no_backup(named or path, verdict)
            if rows.execute("PRAGMA foreign_key_check").fetchone() is not None:
                raise _no_backup(named or path, "a row points to nothing")
            (n_sessions,) = rows.execute("SELECT count(*) FROM sessions").fetchone()
            (n_events,) = rows.execute("SELECT count(*) FROM events WHERE length(payload) > 0").fetchone()
    except sqlite3.Error as error:
        raise _no_backup(named or path, str(error)) from error
    return Contents(n_sessions, n_events)


def _no_backup(path: Path, reason: str) -> StoreError:
    return StoreError(
        f"Expected a whole prefstudy database in {path}, got: {reason}. Nothing was changed; use another backup."
    )


def _sqlite_file(url: str) -> Path:
    parsed = parse_url(url)
    if not sqlite.is_sqlite(parsed):
        raise StoreError(
            f"Expected a SQLite database, got '{url}'. A server keeps its files itself: use its own tool, such as "
            "pg_dump and pg_restore."
        )
    return sqlite.database_path(parsed)


def _refuse_existing(target: Path) -> None:
    if target.exists():
        raise StoreError(f"{target} exists already. Name a new file; backups never overwrite.")
