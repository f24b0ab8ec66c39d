"""The schema: creating an absent one, refusing a strange one, upgrading an old one.

The schema's version is the newest revision in `migrations/`, which Alembic keeps in the database.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import URL, Connection, inspect

from app.store import sqlite
from app.store.engine import explaining_failures, migrating_engine, parse_url, write_lock
from app.store.errors import StoreError
from app.store.locking import serve_lock

MIGRATIONS = Path(__file__).parents[2] / "migrations"

# Tables of the first revision; a database without them was made by another program.
_OUR_TABLES = frozenset({"studies", "sessions", "events"})

# Alembic keeps the running migration in module globals, so one thread migrates at a time.
_migrating = threading.Lock()


class SchemaState(Enum):
    """What stands in a database, seen from this version of the program."""

    ABSENT = "empty"
    CURRENT = "of this version"
    OLDER = "of an older version"
    NEWER = "of a newer version"
    FOREIGN = "another program's"


@dataclass(frozen=True)
class Upgrade:
    """What `upgrade` has done.

    Attributes:
        before: The schema version that it found; None in an empty database.
        after: The schema version that the database has now.
        backup: Copy of the database as it was found; None where nothing was changed, or where it is no SQLite file.
    """

    before: str | None
    after: str
    backup: Path | None


@cache
def head_version() -> str:
    """The schema version this program reads and writes."""
    head = ScriptDirectory.from_config(_config()).get_current_head()
    assert head is not None  # migrations/ is part of the package
    return head


def ensure_schema(url: URL) -> None:
    """Creates the schema when the database is empty, and refuses any other than this version's.

    Raises:
        StoreError: When the database can't be opened, is another program's, or has another schema version.
    """
    with migration_transaction(url) as connection:
        state = schema_state(connection)
        if state is SchemaState.ABSENT:
            _upgrade(connection)
        elif state is not SchemaState.CURRENT:
            raise StoreError(_refusal(url, state, connection))


def upgrade(url: str) -> Upgrade:
    """Brings a database to this version's schema, or creates it; nobody may be serving it meanwhile.

    A SQLite file is copied first.

    Args:
        url: The database's URL.

    Returns:
        What was done.

    Raises:
        StoreError: When it is being served, can't be opened, is another program's, or is newer.
    """
    parsed = parse_url(url)
    with serve_lock(url), migration_transaction(parsed) as connection:
        state = schema_state(connection)
        if state in (SchemaState.FOREIGN, SchemaState.NEWER):
            raise StoreError(_refusal(parsed, state, connection))
        before, backup = _version(connection), None
        # The transaction holds the write lock: nothing is written between the copy and the upgrade.
        if state is SchemaState.OLDER and sqlite.is_sqlite(parsed):
            backup = sqlite.back_up(sqlite.database_path(parsed), f"schema-{before}")
        _upgrade(connection)
    return Upgrade(before, head_version(), backup)


@contextmanager
def migration_transaction(url: URL) -> Iterator[Connection]:
    """A transaction in which the schema may be changed: all of it, or nothing."""
    with write_lock(url), explaining_failures(url), migrating_engine(url).begin() as connection:
        yield connection


def schema_state(connection: Connection) -> SchemaState:
    """Looks at what stands in a database."""
    tables = set(inspect(connection).get_table_names())
    if not tables:
        return SchemaState.ABSENT
    if not _OUR_TABLES.issubset(tables) or _version(connection) is None:
        return SchemaState.FOREIGN
    if _version(connection) == head_version():
        return SchemaState.CURRENT
    known = {revision.revision for revision in ScriptDirectory.from_config(_config()).walk_revisions()}
    return SchemaState.OLDER if _version(connection) in known else SchemaState.NEWER


def _version(connection: Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()


def _refusal(url: URL, state: SchemaState, connection: Connection) -> str:
    if state is SchemaState.FOREIGN:
        return (
            f"Expected a prefstudy database or an empty one at '{url}', found another program's tables. "
            "Nothing was changed; use another --database."
        )
    remedy = (
        "Stop whoever serves it and run `prefstudy migrate`, which keeps a copy."
        if state is SchemaState.OLDER
        else "Install the newer prefstudy that wrote it, or use another --database."
    )
    return (
        f"Expected schema version {head_version()} at '{url}', found {_version(connection)}, "
        f"which is {state.value}. {remedy}"
    )


def _upgrade(connection: Connection) -> None:
    with _migrating:
        command.upgrade(_config(connection), "head")
        if connection.dialect.name == "sqlite":
            sqlite.check_foreign_keys(connection)


def _config(connection: Connection | None = None) -> Config:
    config = Config(attributes={"connection": connection})
    # Alembic reads a percent sign in an option as the start of a reference.
    config.set_main_option("script_location", MIGRATIONS.as_posix().replace("%", "%%"))
    return config
