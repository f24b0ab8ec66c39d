"""Rows that stand together are found in any order, and the table is read once by whoever asks in its own."""

from __future__ import annotations

from collections.abc import Iterator

import pyarrow as pa
import pytest

from app.services.export.runs import Runs

ROWS = {"b": [1, 2, 3], "a": [4], "d": [5, 6]}
ORDER = "bxacdy"
"""Everybody, in the order in which their rows stand; x, c and y have none."""


class Table:
    """A table that comes in batches of two rows, and counts how often it is read, and how far."""

    def __init__(self) -> None:
        self.n_batches = 0

    def read(self) -> Iterator[pa.RecordBatch]:
        flat = [{"who": who, "value": value} for who, values in ROWS.items() for value in values]
        for start in range(0, len(flat), 2):
            self.n_batches += 1
            yield pa.RecordBatch.from_pylist(flat[start : start + 2])

    def runs(self) -> Runs:
        return Runs(self.read, ("who",), lambda key: (ORDER.index(str(key[0])),))


def values(runs: Runs, who: str) -> list[int]:
    return [value for batch in runs.of(who) for value in batch["value"].to_pylist()]


@pytest.mark.parametrize("order", [ORDER, ORDER[::-1], "ddbbxxaa", "ycxycx", "adxb"])
def test_everybodys_rows_are_found_whatever_the_order(order: str) -> None:
    runs = Table().runs()
    assert [values(runs, who) for who in order] == [ROWS.get(who, []) for who in order]


def test_who_asks_in_the_tables_order_has_it_read_once() -> None:
    table = Table()
    runs = table.runs()
    for who in ORDER:
        for _ in range(2):
            values(runs, who)
    assert table.n_batches == 3
