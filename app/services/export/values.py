"""Values of a column: as rows have them, and as Arrow and JSON Lines keep them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any

import pyarrow as pa
import pyarrow.compute as compute

from app.services.export.columns import Column, Kind, Row, TableSchema

_LARGEST = 2**63 - 1
_LARGEST_EXACT = 2**53
"""Up to here, every whole number is a double as well."""


def canonical_json(value: Any) -> str:
    """Returns a JSON value as text: equal values have equal text, in ASCII."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def is_of_kind(kind: Kind, value: Any) -> bool:
    """Returns whether a column of that kind can hold a value."""
    return value is None or _IS_OF_KIND[kind](value)


_IS_OF_KIND: dict[Kind, Callable[[Any], bool]] = {
    "string": lambda value: isinstance(value, str),
    "integer": lambda value: type(value) is int and abs(value) <= _LARGEST,
    "number": lambda value: type(value) is float or (type(value) is int and abs(value) <= _LARGEST_EXACT),
    "boolean": lambda value: type(value) is bool,
    "timestamp": lambda value: isinstance(value, datetime) and value.tzinfo is not None,
    "json": lambda value: True,
}


def batch_of(table: TableSchema, rows: Sequence[Row]) -> pa.RecordBatch:
    """Returns rows as columns; what a row doesn't have is null.

    Raises:
        ValueError: A row has a column that the table doesn't, or a value isn't of its column's kind.
    """
    known = set(table.names)
    for row in rows:
        if not row.keys() <= known:
            raise ValueError(
                f"expected columns of '{table.name}', got {', '.join(sorted(row.keys() - known))}"
            )
    return pa.record_batch([_array(column, rows) for column in table.columns], schema=table.arrow)


def _array(column: Column, rows: Sequence[Row]) -> pa.Array:
    values = [row.get(column.name) for row in rows]
    # One value of each type stands for the others: an export looks at every value there is.
    for value in {type(value): value for value in values}.values():
        if not is_of_kind(column.kind, value):
            raise ValueError(f"expected {column.name} to be of kind {column.kind}, got {value!r}")
    if column.kind == "json":
        values = [None if value is None else canonical_json(value) for value in values]
    try:
        array = pa.array(values, column.arrow_type)
    except OverflowError as error:
        raise ValueError(f"expected {column.name} to be of 64 bits, got more") from error
    if column.kind != "number":
        return array
    # JSON has no other numbers, and an R-hat of infinity says no more than none.
    return compute.if_else(compute.is_finite(array), array, pa.scalar(None, array.type))


def rows_of(table: TableSchema, batch: pa.RecordBatch) -> list[Row]:
    """Returns the rows of a batch, JSON values as they were."""
    columns = [_values(column, batch.column(i)) for i, column in enumerate(table.columns)]
    return [dict(zip(table.names, values, strict=True)) for values in zip(*columns, strict=True)]


def _values(column: Column, array: pa.Array) -> list[Any]:
    values: list[Any] = array.to_pylist()
    if column.kind != "json":
        return values
    return [None if value is None else json.loads(value) for value in values]
