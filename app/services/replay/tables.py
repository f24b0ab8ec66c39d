"""Whether an export's tables say what its logs say: each row is a function of a log, or of what is derived from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from app.services.export import Export
from app.services.export.columns import Row
from app.services.export.rows import log_rows, posterior_row, state_row
from app.services.export.values import batch_of, rows_of
from app.services.replay.errors import ReplayDifferenceError
from app.services.replay.person import ExportedPerson
from app.store import PosteriorRecord

_IDS = ("person_id", "study_hash", "study_version")
_OF_THE_LOG = ("steps", "responses", "queries", "answers")


def compare_tables(export: Export, person: ExportedPerson) -> None:
    """Compares a person's rows with their log.

    Raises:
        ReplayDifferenceError: A row isn't what the log says; the message names table, row and column.
    """
    expected: dict[str, list[Row]] = {name: [] for name in _OF_THE_LOG}
    for table, row in log_rows(person.study, person.records, person.log):
        expected[table].append(row)
    for table, rows in expected.items():
        _compare(export, person, table, rows, export.rows_of(table, person.id))
    _compare(export, person, "people", [state_row(person.study, person.state)], [person.row])


def compare_posteriors(
    export: Export, person: ExportedPerson, derived: Mapping[int, PosteriorRecord]
) -> None:
    """Compares a person's rows of posteriors, and the samples as far as they were exported, with what is derived.

    Raises:
        ReplayDifferenceError: A row isn't what was derived; the message names table, query and column.
    """
    records = [derived[index] for index in sorted(derived)]
    rows = [posterior_row(person.study, record) for record in records]
    _compare(export, person, "posteriors", rows, export.rows_of("posteriors", person.id))
    for record in records:
        samples = export.samples(person.id, record.query_index)
        if len(samples):
            _compare_samples(person, record.query_index, samples, record.samples, "weight")
            kept = export.parameters(person.id, record.query_index)
            if kept is not None and record.parameters is not None:
                _compare_samples(person, record.query_index, kept, record.parameters, "response parameter")


def _compare_samples(
    person: ExportedPerson, query_index: int, stored: np.ndarray, derived: np.ndarray, what: str
) -> None:
    where = f"{person.source}: table samples, query {query_index}"
    if stored.shape != derived.shape:
        raise ReplayDifferenceError(
            f"{where}: expected {derived.shape[0]} samples of {derived.shape[1]} numbers, found {stored.shape}."
        )
    differing = np.argwhere(stored != derived)
    if len(differing):
        row, column = differing[0]
        raise ReplayDifferenceError(
            f"{where}, sample {row}: {what} {column}: stored {float(stored[row, column])!r}, derived "
            f"{float(derived[row, column])!r}."
        )


def _compare(
    export: Export, person: ExportedPerson, table: str, expected: Sequence[Row], stored: Sequence[Row]
) -> None:
    """Compares rows of a table; only the columns that are expected."""
    where = f"{person.source}: table {table}"
    if len(expected) != len(stored):
        raise ReplayDifferenceError(f"{where}: expected {len(expected)} rows, found {len(stored)}.")
    schema = export.manifest.tables[table]
    known = rows_of(schema, batch_of(schema, expected))
    for number, (row, plain, found) in enumerate(zip(expected, known, stored, strict=True)):
        # Of a person's own row, the log says a part.
        names = row.keys() if table == "people" else [name for name in schema.names if name not in _IDS]
        name = next((each for each in names if plain[each] != found[each]), None)
        if name is not None:
            query = found.get("query_index")
            which = f"row {number} of the person" if query is None else f"query {query}"
            raise ReplayDifferenceError(
                f"{where}, {which}: {name}: stored {found[name]!r}, derived {plain[name]!r}."
            )
