"""A table of an export that is being written, with the digests of its rows beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import pyarrow as pa

from app.services.export.blocks import Blocks
from app.services.export.columns import TableSchema
from app.services.export.digests import TableDigest
from app.services.export.files import new_file
from app.services.export.layout import Form, digests_path, file_form, table_path


@contextmanager
def open_table(folder: Path, form: Form, schema: TableSchema) -> Iterator[OpenTable]:
    """Gives a table in a new file of an export's folder."""
    path, digests = folder / table_path(form, schema.name), folder / digests_path(schema.name)
    for each in (path, digests):
        each.parent.mkdir(parents=True, exist_ok=True)
    with (
        new_file(path, file_form(form), schema) as write,
        digests.open("x", encoding="utf-8") as edges,
    ):
        table = OpenTable(schema, write, edges.write)
        yield table
        table.finish()


class OpenTable:
    """Rows as they come, a person's at a time.

    Attributes:
        schema: The table's columns.
        digest: Of the rows that were written.
    """

    def __init__(
        self, schema: TableSchema, write: Callable[[pa.RecordBatch], None], digests: Callable[[str], int]
    ) -> None:
        self.schema = schema
        self.digest = TableDigest(schema)
        self._blocks = Blocks(schema.block)
        self._write = write
        self._write_digests = digests

    def add(self, batch: pa.RecordBatch) -> None:
        """Takes some rows."""
        for block in self._blocks.add(batch):
            self._put(block)

    def finish(self) -> None:
        """Writes what waits."""
        for block in self._blocks.rest():
            self._put(block)

    def _put(self, block: pa.RecordBatch) -> None:
        self._write(block)
        self._write_digests(json.dumps(asdict(self.digest.add(block))) + "\n")
