"""A table in a file: CSV, Parquet or JSON Lines, written block by block from typed rows, and read back as them.

CSV: UTF-8, `true` and `false`, nothing for null (an empty text is `""`), timestamps in ISO 8601 with their offset,
numbers in the shortest form that reads back to the same double, JSON in one cell. JSON Lines: one object a row, with
every column.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.csv
import pyarrow.parquet

from app.services.export.columns import Column, Row, TableSchema
from app.services.export.layout import FileForm
from app.services.export.values import batch_of

Write = Callable[[pa.RecordBatch], None]

# The longest row must fit: that of a learned feature, with its networks.
_CSV_BYTES_AT_ONCE = 1 << 24
_JSON_ROWS_AT_ONCE = 1024
_ISO_8601 = "%Y-%m-%dT%H:%M:%S+00:00"


def new_file(path: Path, form: FileForm, table: TableSchema) -> AbstractContextManager[Write]:
    """Opens a new file for a table; gives what writes a block of rows to it."""
    return {"csv": _new_csv, "parquet": _new_parquet, "jsonl": _new_json_lines}[form](path, table)


def batches_in(path: Path, form: FileForm, table: TableSchema) -> Iterator[pa.RecordBatch]:
    """Gives the rows of a file in batches of any length.

    Raises:
        OSError: The file can't be read.
        ValueError: It isn't of that form, hasn't the table's columns, or a value isn't of its column's kind.
    """
    return {"csv": _read_csv, "parquet": _read_parquet, "jsonl": _read_json_lines}[form](path, table)


@contextmanager
def _new_csv(path: Path, table: TableSchema) -> Iterator[Write]:
    schema = pa.schema([(column.name, _csv_type(column)) for column in table.columns])

    def write(block: pa.RecordBatch) -> None:
        writer.write_batch(pa.record_batch([_csv_array(array) for array in block.columns], schema=schema))

    with path.open("xb") as file, pyarrow.csv.CSVWriter(file, schema) as writer:
        yield write


def _csv_type(column: Column) -> pa.DataType:
    return pa.string() if column.kind == "timestamp" else column.arrow_type


def _csv_array(array: pa.Array) -> pa.Array:
    return compute.strftime(array, _ISO_8601) if pa.types.is_timestamp(array.type) else array


def _read_csv(path: Path, table: TableSchema) -> Iterator[pa.RecordBatch]:
    # One thread, so that a value that can't be read is named with its row.
    reading = pyarrow.csv.ReadOptions(use_threads=False, block_size=_CSV_BYTES_AT_ONCE)
    parsing = pyarrow.csv.ParseOptions(newlines_in_values=True)
    converting = pyarrow.csv.ConvertOptions(
        column_types={column.name: column.arrow_type for column in table.columns},
        null_values=[""],
        true_values=["true"],
        false_values=["false"],
        strings_can_be_null=True,
        quoted_strings_can_be_null=False,
    )
    with pyarrow.csv.open_csv(path, reading, parsing, converting) as batches:
        _require_columns(table, batches.schema.names)
        for batch in batches:
            yield batch.cast(table.arrow)


@contextmanager
def _new_parquet(path: Path, table: TableSchema) -> Iterator[Write]:
    with (
        path.open("xb") as file,
        pyarrow.parquet.ParquetWriter(file, table.arrow, compression="zstd") as writer,
    ):
        yield writer.write_batch


def _read_parquet(path: Path, table: TableSchema) -> Iterator[pa.RecordBatch]:
    with pyarrow.parquet.ParquetFile(path) as file:
        _require_columns(table, file.schema_arrow.names)
        for batch in file.iter_batches(table.block):
            yield batch.cast(table.arrow)


@contextmanager
def _new_json_lines(path: Path, table: TableSchema) -> Iterator[Write]:
    encoder = msgspec.json.Encoder()

    def write(block: pa.RecordBatch) -> None:
        columns = [_json_values(column, block.column(i)) for i, column in enumerate(table.columns)]
        rows = [dict(zip(table.names, values, strict=True)) for values in zip(*columns, strict=True)]
        file.write(encoder.encode_lines(rows))

    with path.open("xb") as file:
        yield write


def _json_values(column: Column, array: pa.Array) -> list[Any]:
    if column.kind == "json":
        return [None if text is None else msgspec.Raw(text.encode()) for text in array.to_pylist()]
    values: list[Any] = _csv_array(array).to_pylist()
    return values


def _read_json_lines(path: Path, table: TableSchema) -> Iterator[pa.RecordBatch]:
    timestamps = [column.name for column in table.columns if column.kind == "timestamp"]
    with path.open(encoding="utf-8") as lines:
        rows = (_json_row(table, timestamps, number, line) for number, line in enumerate(lines, start=1))
        while some := list(islice(rows, _JSON_ROWS_AT_ONCE)):
            yield batch_of(table, some)


def _json_row(table: TableSchema, timestamps: list[str], number: int, line: str) -> Row:
    row: Any = json.loads(line)
    if not isinstance(row, dict):
        raise ValueError(f"line {number}: expected an object, got {line[:60]}")
    _require_columns(table, tuple(row))
    for name in timestamps:
        if row[name] is not None:
            row[name] = _timestamp(name, number, row[name])
    return row


def _timestamp(name: str, number: int, text: Any) -> datetime:
    at = datetime.fromisoformat(text) if isinstance(text, str) else None
    if at is None or at.tzinfo is None:
        raise ValueError(f"line {number}: expected {name} with its offset, got {text}")
    return at


def _require_columns(table: TableSchema, names: Sequence[str]) -> None:
    if tuple(names) != table.names:
        missing, strange = set(table.names) - set(names), set(names) - set(table.names)
        told = "; ".join(
            f"{what}: {', '.join(sorted(some))}"
            for what, some in (("missing", missing), ("unknown", strange))
            if some
        )
        raise ValueError(
            f"expected the columns of '{table.name}' in their order ({told or 'they are in another'})"
        )
