"""Digests of typed rows, whatever file they stand in: one of each row, and one of each column of a block of rows.

As with the sums at the edges of a ledger, a number that was changed is found by its row's digest and its column's.

A value is one byte that says whether there is one, and eight of what it is (integers, doubles, microseconds), or its
length and its UTF-8. A row is its values of fixed width in the table's order, then the others. A digest is SHA-256;
of the rows' and the columns' own, the first 16 hexadecimal digits are kept, while the table's runs over the whole of
each row's.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from jaxtyping import UInt8

from app.services.export.columns import Column, TableSchema
from app.services.export.values import canonical_json

_KEPT = 16
_VARIABLE = ("string", "json")


@dataclass(frozen=True)
class Edges:
    """The digests at the edges of a block of rows, 16 hexadecimal digits each.

    Attributes:
        rows: One a row.
        columns: One a column, by name.
    """

    rows: list[str]
    columns: dict[str, str]


class TableDigest:
    """The digests of a table that comes block by block."""

    def __init__(self, table: TableSchema) -> None:
        self._table = table
        schema = [[column.name, column.kind] for column in table.columns]
        self._sha256 = hashlib.sha256(canonical_json([table.name, schema]).encode())
        self.n_rows = 0

    def add(self, block: pa.RecordBatch) -> Edges:
        """Takes the next rows; returns their digests."""
        columns = {
            column.name: _canonical(column, block.column(i)) for i, column in enumerate(self._table.columns)
        }
        rows = _row_digests(list(columns.values()), block.num_rows)
        self._sha256.update(b"".join(rows))
        self.n_rows += block.num_rows
        return Edges(
            [row.hex()[:_KEPT] for row in rows],
            {name: _column_digest(values) for name, values in columns.items()},
        )

    def hexdigest(self) -> str:
        """Returns the SHA-256 of the table so far: its columns' names and kinds, and every row's digest."""
        return self._sha256.hexdigest()


def _row_digests(columns: list[UInt8[np.ndarray, "n 9"] | list[bytes]], n_rows: int) -> list[bytes]:
    fixed = [values for values in columns if isinstance(values, np.ndarray)]
    variable = [values for values in columns if not isinstance(values, np.ndarray)]
    content = np.concatenate(fixed, axis=1).tobytes() if fixed else b""
    width = 9 * len(fixed)
    rest = map(b"".join, zip(*variable, strict=True)) if variable else iter([b""] * n_rows)
    return [
        hashlib.sha256(content[i * width : (i + 1) * width] + text).digest() for i, text in enumerate(rest)
    ]


def _column_digest(values: UInt8[np.ndarray, "n 9"] | list[bytes]) -> str:
    content = values.tobytes() if isinstance(values, np.ndarray) else b"".join(values)
    return hashlib.sha256(content).hexdigest()[:_KEPT]


def _canonical(column: Column, array: pa.Array) -> UInt8[np.ndarray, "n 9"] | list[bytes]:
    """Returns the bytes of each value."""
    if column.kind in _VARIABLE:
        return [_text(value) for value in array.cast(pa.binary()).to_pylist()]
    bits = np.empty((len(array), 9), dtype=np.uint8)
    bits[:, 0] = array.is_valid().to_numpy(zero_copy_only=False)
    if column.kind == "number":
        values = array.fill_null(0.0).to_numpy(zero_copy_only=False).astype("<f8")
    else:
        values = array.cast(pa.int64()).fill_null(0).to_numpy(zero_copy_only=False).astype("<i8")
    bits[:, 1:] = values.view(np.uint8).reshape(-1, 8)
    return bits


def _text(value: bytes | None) -> bytes:
    return b"\0" if value is None else b"\1" + len(value).to_bytes(8, "little") + value
