"""What a table's columns are: declared once, with unit and meaning, the same in every file format."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import pyarrow as pa

Kind = Literal["string", "integer", "number", "boolean", "timestamp", "json"]
"""A timestamp is in UTC, to the microsecond; json is any JSON value, kept as text where a format knows none."""

Row = dict[str, Any]
"""One value a column. Timestamps are aware, JSON is as `json.loads` gives it, None is nothing."""

_ARROW: dict[Kind, pa.DataType] = {
    "string": pa.string(),
    "integer": pa.int64(),
    "number": pa.float64(),
    "boolean": pa.bool_(),
    "timestamp": pa.timestamp("us", "UTC"),
    "json": pa.string(),
}


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: As it stands in every file.
        kind: What its values are.
        description: What it says, in a sentence.
        unit: Such as `ms`; empty where there is none.
        levels: The values it may have, where they are few.
        least: The smallest value it may have, where there is one.
        most: The largest.
    """

    name: str
    kind: Kind
    description: str
    unit: str = ""
    levels: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None

    @property
    def arrow_type(self) -> pa.DataType:
        """Returns the type of its values in memory and in Parquet."""
        return _ARROW[self.kind]


@dataclass(frozen=True)
class TableSchema:
    """One table.

    Attributes:
        name: Also of its file.
        description: What one row is.
        columns: From left to right.
        block: So many rows are written, and get their digests, together.
    """

    name: str
    description: str
    columns: tuple[Column, ...]
    block: int = 4096

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Returns the columns' names."""
        return tuple(column.name for column in self.columns)

    @cached_property
    def arrow(self) -> pa.Schema:
        """Returns the table's schema in memory and in Parquet, with what each column says."""
        return pa.schema(
            [
                pa.field(each.name, each.arrow_type, metadata={"description": each.description})
                for each in self.columns
            ]
        )


def distinct(names: Iterable[Iterable[str]]) -> tuple[str, ...]:
    """Returns every name once, in the order in which they first come."""
    return tuple(dict.fromkeys(name for some in names for name in some))
