"""Opening a database by its URL, and the two ways to use it: reading and writing."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from sqlalchemy import URL, Engine, NullPool, create_engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.orm import Session

from app.store import sqlite
from app.store.errors import StoreError

_DRIVERS = ("sqlite", "sqlite+pysqlite", "postgresql+psycopg")


def parse_url(url: str) -> URL:
    """Reads a database URL.

    Raises:
        StoreError: When it isn't one, or names a driver the store doesn't speak.
    """
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise StoreError(
            f"Expected a database URL, got '{url}'. Use one such as sqlite:///study.db."
        ) from error
    if parsed.drivername not in _DRIVERS:
        raise StoreError(
            f"Expected a database URL that begins with one of {', '.join(_DRIVERS)}; "
            f"got '{parsed.drivername}'. Use one such as sqlite:///study.db."
        )
    if sqlite.is_sqlite(parsed):
        sqlite.database_path(parsed)
    return parsed


def serving_engine(url: URL) -> Engine:
    """An engine for everyday work."""
    # A web server's threads each hold a connection for a moment; none should wait for another's to come back.
    engine = _create(url, pool_size=8, max_overflow=56)
    if sqlite.is_sqlite(url):
        sqlite.configure(engine)
    return engine


def migrating_engine(url: URL) -> Engine:
    """An engine for looking at a schema and changing it; it keeps no connection open."""
    engine = _create(url, poolclass=NullPool)
    if sqlite.is_sqlite(url):
        sqlite.configure_for_schema_changes(engine)
    return engine.execution_options(**{sqlite.WRITES: True})


def write_lock(url: URL) -> AbstractContextManager[object]:
    """What a writer of this process holds while it writes."""
    if sqlite.is_sqlite(url):
        return sqlite.write_lock(sqlite.database_path(url))
    return nullcontext()


@contextmanager
def explaining_failures(url: URL) -> Iterator[None]:
    """Turns what the database driver raises into a `StoreError` with a remedy."""
    try:
        yield
    except (DBAPIError, PoolTimeoutError) as error:
        reason = error.orig if isinstance(error, DBAPIError) else error
        raise StoreError(
            f"Expected a database to read and write at '{url}', got: {reason}. Check that it is a prefstudy "
            "database, that you may write to it and its folder, that the disk has room and that no other "
            "program keeps it locked, or use another --database."
        ) from error


class Database:
    """An open database."""

    def __init__(self, url: URL) -> None:
        """Opens nothing yet; connections are made when they are needed.

        Args:
            url: Where the database is; its schema is known to be the right one.
        """
        self._url = url
        self._engine = serving_engine(url)
        self._writing_engine = self._engine.execution_options(**{sqlite.WRITES: True})
        self._write_lock = write_lock(url)
        self._is_closed = threading.Event()

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """A transaction that sees the database at one moment."""
        self._refuse_when_closed()
        with explaining_failures(self._url), Session(self._engine) as rows:
            yield rows

    @contextmanager
    def writing(self) -> Iterator[Session]:
        """A transaction that writes everything or nothing, and is durable when the block is left."""
        self._refuse_when_closed()
        with (
            self._write_lock,
            explaining_failures(self._url),
            Session(self._writing_engine, expire_on_commit=False) as rows,
            rows.begin(),
        ):
            yield rows

    @property
    def free_bytes(self) -> int | None:
        """How much room is left where the database is; None on a server that keeps its files itself."""
        if not sqlite.is_sqlite(self._url):
            return None
        return shutil.disk_usage(sqlite.database_path(self._url).parent).free

    def wipe(self) -> bool:
        """Removes from the database's files what its tables no longer hold.

        Returns:
            Whether nothing is left; never so on a server that keeps its files itself.
        """
        if not sqlite.is_sqlite(self._url):
            return False
        with self._write_lock, explaining_failures(self._url):
            return sqlite.wipe(self._engine)

    def close(self) -> None:
        """Closes every connection; whoever comes later is refused."""
        self._is_closed.set()
        with self._write_lock:
            self._engine.dispose()

    def _refuse_when_closed(self) -> None:
        if self._is_closed.is_set():
            raise StoreError("Expected an open store, got a closed one. Open it again with open_store().")


def _create(url: URL, **options: object) -> Engine:
    try:
        return create_engine(url, **options)
    except (ImportError, NoSuchModuleError) as error:
        raise StoreError(
            f"Expected the driver for '{url.drivername}' to be installed, found none ({error}). "
            "Install it (for PostgreSQL: pip install psycopg) or use sqlite:///study.db."
        ) from error
