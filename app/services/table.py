"""Tidy tables in files: one row a thing, as CSV or as JSON Lines."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TextIO

from app.errors import AppError
from app.new_file import open_new

Row = dict[str, Any]
Format = Literal["csv", "jsonl"]

_FORMATS: dict[str, Format] = {".csv": "csv", ".jsonl": "jsonl"}


class TableError(AppError):
    """A table that can't be written."""


class Table:
    """One file, written row by row. All rows have the same keys; in CSV, lists and mappings become columns."""

    def __init__(self, file: TextIO, form: Format) -> None:
        self._file = file
        self._is_csv = form == "csv"
        self._writer: csv.DictWriter[str] | None = None

    def write(self, row: Row) -> None:
        """Adds a row."""
        if not self._is_csv:
            self._file.write(json.dumps(row) + "\n")
            return
        flat = dict(_flatten(row))
        if self._writer is None:
            self._writer = csv.DictWriter(self._file, list(flat), lineterminator="\n")
            self._writer.writeheader()
        self._writer.writerow(flat)


@contextmanager
def new_table(path: Path) -> Iterator[Table]:
    """Gives a table in a new file, of the format that its name ends in.

    Raises:
        TableError: The name ends otherwise.
        NewFileError: The file exists, or can't be made.
    """
    form = _FORMATS.get(path.suffix)
    if form is None:
        raise TableError(
            f"Expected a file name that ends in {' or '.join(_FORMATS)}, got {path}. Name it so."
        )
    with open_new(path) as file:
        yield Table(file, form)


# What has no fixed entries.
_ONE_CELL = {"payload", "other_ids", "stream", "versions", "clips", "value", "viewport", "other"}


def _flatten(row: Row) -> Iterator[tuple[str, Any]]:
    """Gives lists and mappings as one column an entry; what has no fixed entries stays JSON in one cell."""
    for key, value in row.items():
        if key in _ONE_CELL and isinstance(value, (dict, list)):
            yield key, json.dumps(value)
        elif isinstance(value, dict):
            yield from ((f"{key}_{name}", entry) for name, entry in value.items())
        elif isinstance(value, list):
            yield from ((f"{key}_{i}", entry) for i, entry in enumerate(value))
        else:
            yield key, value
