"""Everything that holds for SQLite only: its files, its settings, its one writer at a time."""

from __future__ import annotations

import os
import sqlite3
import time
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Connection, Engine, event

from app.store.errors import StoreError
from app.store.turns import Turns

BUSY_TIMEOUT_MS = 30_000
WRITES = "prefstudy_writes"
"""Execution option of connections whose transactions write."""

# Writers of one process queue here instead of polling SQLite's own lock, which favours nobody and is slow
# when many wait.
_WRITE_LOCKS: dict[Path, Turns] = {}


def is_sqlite(url: URL) -> bool:
    """Whether the URL names a SQLite database."""
    return url.get_backend_name() == "sqlite"


def database_path(url: URL) -> Path:
    """The database's file.

    Raises:
        StoreError: When the URL names no ordinary file or one that can't be written to, or its folder
            doesn't exist.
    """
    name = url.database
    if not name or name == ":memory:" or name.startswith("file:"):
        raise StoreError(
            f"Expected a SQLite file, got '{url}', which would not outlive the program. "
            "Use a URL such as sqlite:///study.db."
        )
    path = Path(name).absolute()
    if path.is_dir():
        raise StoreError(f"Expected a SQLite file, got the folder {path}. Name a file inside it.")
    if not path.parent.is_dir():
        raise StoreError(f"Expected a folder at {path.parent} for the database, found none. Create it first.")
    if path.exists() and not os.access(path, os.W_OK):
        # SQLite would open it and complain only about the first answer.
        raise StoreError(
            f"Expected a database to write to at {path}, which is read-only. Change its permissions."
        )
    return path


def write_lock(path: Path) -> Turns:
    """The lock that writers of this process hold; the same one for every spelling of the path."""
    return _WRITE_LOCKS.setdefault(path.resolve(), Turns())


def configure(engine: Engine) -> None:
    """Makes every connection of the engine durable, strict and patient."""
    event.listen(engine, "connect", _prepare_durable_connection)
    event.listen(engine, "begin", _begin)


def configure_for_schema_changes(engine: Engine) -> None:
    """Makes every connection of the engine fit for looking at a strange file and for migrations.

    The journal mode is left alone, since the file may be another program's. Foreign keys stay off, since
    Alembic's batch mode drops and rebuilds the tables they point to; `check_foreign_keys` makes up for it.
    """
    event.listen(engine, "connect", _prepare_connection)
    event.listen(engine, "begin", _begin)


def check_foreign_keys(connection: Connection) -> None:
    """Checks every foreign key of the database.

    Raises:
        StoreError: When a row points to nothing.
    """
    broken = connection.exec_driver_sql("PRAGMA foreign_key_check").all()
    if broken:
        raise StoreError(
            f"Expected every row to point to an existing one, found {len(broken)} that don't, the first in "
            f"table '{broken[0][0]}'. Nothing was changed; restore the database from a backup."
        )


def wipe(engine: Engine) -> bool:
    """Rewrites the file without what has been removed, and empties the write-ahead log, which still holds it.

    Zeros alone (`secure_delete`) don't reach every copy that was left behind when SQLite moved rows between pages.

    Returns:
        Whether both were done; not so while another connection reads an older state.
    """
    connection = engine.raw_connection()
    try:
        connection.execute("VACUUM")
        is_busy, _, _ = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    except sqlite3.OperationalError as error:
        if "locked" not in str(error) and "busy" not in str(error):
            raise
        return False
    finally:
        connection.close()
    return not is_busy


def back_up(path: Path, label: str) -> Path:
    """Copies a database as it stands to a new file next to it.

    Args:
        path: The database's file.
        label: What to call the state that is kept, in the copy's name.

    Returns:
        The copy.
    """
    copy = name_of_copy(path, label)
    with closing(sqlite3.connect(path)) as original, closing(sqlite3.connect(copy)) as target:
        original.backup(target)
    return copy


def name_of_copy(path: Path, label: str) -> Path:
    """A new name for a copy of a database, next to it."""
    at = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%fZ")
    return path.with_name(f"{path.name}.{label}.{at}.bak")


def _prepare_connection(dbapi_connection: Any, _record: object) -> None:
    # None: the driver begins no transactions of its own; `_begin` does, with the right kind of lock.
    dbapi_connection.isolation_level = None
    dbapi_connection.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_MS}")
    # What is removed, or replaced, is overwritten with zeros in the file.
    dbapi_connection.execute("PRAGMA secure_delete = ON")


def _prepare_durable_connection(dbapi_connection: Any, record: object) -> None:
    _prepare_connection(dbapi_connection, record)
    _switch_to_write_ahead_log(dbapi_connection)
    # FULL: a commit is on the disk before it returns, also in WAL mode.
    dbapi_connection.execute("PRAGMA synchronous = FULL")
    dbapi_connection.execute("PRAGMA foreign_keys = ON")


def _switch_to_write_ahead_log(dbapi_connection: Any) -> None:
    # The switch itself doesn't heed busy_timeout: of two processes that open a new file at once, one is told
    # "database is locked" immediately. After the first time the switch is a look at the file's header.
    give_up_at = time.monotonic() + BUSY_TIMEOUT_MS / 1000
    while True:
        try:
            mode = dbapi_connection.execute("PRAGMA journal_mode = WAL").fetchone()[0]
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > give_up_at:
                raise
            time.sleep(0.005)
        else:
            _require_write_ahead_log(mode)
            return


def _require_write_ahead_log(mode: str) -> None:
    if mode != "wal":
        raise StoreError(
            f"Expected a file system that carries SQLite's write-ahead log, got journal mode '{mode}'. "
            "Put the database on a local disk."
        )


def _begin(connection: Connection) -> None:
    # A transaction that reads first and writes later can fail halfway with "database is locked", and waiting
    # doesn't help it. So a writer takes the write lock at once.
    is_writing = connection.get_execution_options().get(WRITES, False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if is_writing else "BEGIN")
