"""One server, or one migration, per SQLite file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from filelock import FileLock, Timeout

from app.store import sqlite
from app.store.engine import parse_url
from app.store.errors import StoreError


@contextmanager
def serve_lock(url: str) -> Iterator[None]:
    """Holds a database for one server; the operating system lets go of it when the process dies.

    Other programs may still write to the database through the store meanwhile. Only SQLite files are locked.

    Args:
        url: The database's URL.

    Raises:
        StoreError: When somebody else holds it.
    """
    parsed = parse_url(url)
    if not sqlite.is_sqlite(parsed):
        yield
        return
    database = sqlite.database_path(parsed).resolve()
    path = database.with_name(database.name + ".lock")
    lock = FileLock(path, timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        holder = path.read_text().strip() or "another process"
        raise StoreError(
            f"Expected '{url}' to be free, but it is already served by {holder}; "
            "stop it or use another --database."
        ) from error
    except OSError as error:
        raise StoreError(
            f"Expected to lock '{url}' with the file {path}, got: {error}. "
            "Check that you may write to the folder, or use another --database."
        ) from error
    try:
        path.write_text(f"process {os.getpid()}")
        yield
    finally:
        lock.release()
