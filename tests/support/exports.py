"""Exports that are replayed, and exports that somebody has changed."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from app import wiring
from app.services.export import open_export
from app.services.export.blocks import in_blocks
from app.services.export.digests import TableDigest
from app.services.export.files import batches_in
from app.services.export.layout import digests_path, file_form, table_path
from app.services.export.manifest import read_manifest
from app.services.replay import PersonReplayed, Reproduction, survey
from app.services.runtime import Runtime

Json = dict[str, Any]


def replayed(folder: Path, by_steps: bool = False, runtime: Runtime | None = None) -> list[PersonReplayed]:
    """Everybody in an export, as `prefstudy replay` has them; by a runtime of their own unless one is named."""
    export = open_export(folder)
    export.check_digests()
    survey(export)
    with nullcontext(runtime) if runtime else wiring.headless() as computing:
        return list(Reproduction(computing, export, by_steps).run())


def rows(folder: Path, table: str) -> list[Json]:
    """The rows of a table in JSON Lines."""
    return [json.loads(line) for line in (folder / f"{table}.jsonl").read_text().splitlines()]


def edit(folder: Path, table: str, change: Callable[[list[Json]], None]) -> None:
    """Changes the rows of a table in JSON Lines, as with an editor."""
    known = rows(folder, table)
    change(known)
    (folder / f"{table}.jsonl").write_text("".join(json.dumps(row) + "\n" for row in known))


def mend(folder: Path) -> None:
    """Writes the digests that fit the rows as they are now: what somebody would do who wants nobody to notice."""
    manifest = read_manifest(folder)
    n_rows, table_digests, files = {}, {}, dict(manifest.file_digests)
    for name, schema in manifest.tables.items():
        digest, lines = TableDigest(schema), []
        path = folder / table_path(manifest.form, name)
        for block in in_blocks(batches_in(path, file_form(manifest.form), schema), schema.block):
            lines.append(json.dumps(asdict(digest.add(block))) + "\n")
        (folder / digests_path(name)).write_text("".join(lines))
        n_rows[name], table_digests[name] = digest.n_rows, digest.hexdigest()
        files[digests_path(name)] = hashlib.sha256("".join(lines).encode()).hexdigest()
    replace(manifest, n_rows=n_rows, table_digests=table_digests, file_digests=files).write(folder)


def say_computed_elsewhere(database: Path) -> None:
    """Makes a SQLite database say that another type of processor computed its queries."""
    with sqlite3.connect(database) as connection:
        for session_id, position, payload in connection.execute(
            "SELECT session_id, position, payload FROM events WHERE kind = 'query_prepared'"
        ).fetchall():
            content = json.loads(payload) | {"machine": "aarch64, another (cortex-a72): neon"}
            connection.execute(
                "UPDATE events SET payload = ? WHERE session_id = ? AND position = ?",
                (json.dumps(content), session_id, position),
            )
