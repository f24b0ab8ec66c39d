"""Comparing an export with its own digests, and saying what exactly is different."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from app.services.export.columns import Row, TableSchema
from app.services.export.digests import Edges, TableDigest
from app.services.export.errors import ExportDifferenceError, ExportError
from app.services.export.layout import digests_path
from app.services.export.manifest import file_digest
from app.services.export.rows import log_rows
from app.services.export.values import rows_of
from app.store import EventRecord
from study_core import session_codec
from study_core.errors import StudyCoreError

if TYPE_CHECKING:
    from app.services.export.reading import Export

_FROM_THE_LOG = ("steps", "responses", "queries", "answers")
_MOST_LETTERS = 60


def check(export: Export, on_row: Callable[[int], None]) -> None:
    """Compares every row and file with its digest; see `Export.check_digests`."""
    for name in export.tables:
        _check_table(export, export.manifest.tables[name], on_row)
    for name, digest in export.manifest.file_digests.items():
        path = export.folder / name
        if not path.is_file():
            raise ExportDifferenceError(f"{path} was exported and is missing. Export again.")
        if file_digest(path) != digest:
            raise ExportDifferenceError(f"{path} was changed after the export. Export again.")


def _check_table(export: Export, table: TableSchema, on_row: Callable[[int], None]) -> None:
    path, digest, edges = export.path_of(table.name), TableDigest(table), export.edges(table.name)
    for block in export.blocks(table.name):
        n_before = digest.n_rows
        found, stored = digest.add(block), next(edges, Edges([], {}))
        if found != stored:
            raise _difference(export, table, block, found, stored, n_before)
        on_row(block.num_rows)
    told = export.manifest.n_rows[table.name]
    if digest.n_rows < told:
        raise ExportDifferenceError(
            f"{path}: expected {told} rows, found {digest.n_rows}: some are missing at the end. Export again."
        )
    if digest.hexdigest() != export.manifest.table_digests[table.name]:
        digests = export.folder / digests_path(table.name)
        raise ExportDifferenceError(f"{path} and {digests} were both changed after the export. Export again.")


def _difference(
    export: Export, table: TableSchema, block: pa.RecordBatch, found: Edges, stored: Edges, n_before: int
) -> ExportDifferenceError:
    """Returns what to say of the first row of a block that isn't as it was written."""
    path = export.path_of(table.name)
    pairs = enumerate(zip(found.rows, stored.rows, strict=False))
    at = next((i for i, (one, other) in pairs if one != other), min(len(found.rows), len(stored.rows)))
    if at == block.num_rows:
        missing = f"{path}: expected more rows after row {n_before + at}, which is the last. Export again."
        return ExportDifferenceError(missing)
    (row,) = rows_of(table, block.slice(at, 1))
    where = f"{path}, row {n_before + at + 1}{_whose(row)}"
    if at == len(stored.rows):
        return ExportDifferenceError(f"{where}: expected no such row; it was added later. Export again.")
    changed = [name for name in table.names if found.columns[name] != stored.columns.get(name)]
    if len(changed) == len(table.names) or len(found.rows) != len(stored.rows):
        return ExportDifferenceError(
            f"{where}: expected another row; rows were added, removed or moved after the export. Export again."
        )
    told = ", ".join(f"{name} is {_short(row[name])}" for name in changed[:3])
    beside = "; ".join(_beside(export, table, row))
    return ExportDifferenceError(
        f"{where}: {told}, which is not what was exported{f' ({beside})' if beside else ''}. Export again."
    )


def _whose(row: Row) -> str:
    """Returns whose row it is, and which query's, as far as its table says."""
    names = {
        "person_id": "person",
        "query_index": "query",
        "position": "log position",
        "sample": "sample",
        "item": "item",
    }
    told = [f"{what} {row[name]}" for name, what in names.items() if row.get(name) is not None]
    return f" ({', '.join(told)})" if told else ""


def _beside(export: Export, table: TableSchema, row: Row) -> Iterator[str]:
    """Gives where the log and the tables that follow from it contradict each other, at the place of a row."""
    if table.name not in (*_FROM_THE_LOG, "events"):
        return
    events = [
        EventRecord(each["position"], each["kind"], each["payload"], each["at"])
        for each in export.events(row["person_id"])
    ]
    try:
        log = tuple(session_codec.from_json(each.kind, each.payload) for each in events)
        again = list(log_rows(export.study(row["study_hash"]), events, log))
    except (ExportError, StudyCoreError, TypeError, ValueError, LookupError):
        return  # what was changed is what the log is read by
    for name in _FROM_THE_LOG:
        here = [each for each in export.rows(name) if _place(each) == _place(row)]
        derived = [each for of, each in again if of == name and each["position"] == row["position"]]
        for one, other in zip(here, derived, strict=False):
            yield from _contradictions(name, one, other)


def _contradictions(table: str, row: Row, derived: Row) -> Iterator[str]:
    for name, expected in derived.items():
        if row[name] != expected:
            yield f"{name} of {table} is {_short(row[name])} there and {_short(expected)} in the log"


def _place(row: Row) -> tuple[str, int]:
    return row["person_id"], row["position"]


def _short(value: Any) -> str:
    # A double says itself in full; a log's entry may be as long as a learned feature.
    text = repr(str(value)) if isinstance(value, str) else str(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[:_MOST_LETTERS]}..."
