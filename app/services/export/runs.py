"""Rows of one person, or of one query, in a table whose rows stand in everybody's order."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pyarrow as pa

_Key = tuple[object, ...]


class Runs:
    """Finds rows that stand together. Whoever asks in the table's order has it read once, and never kept."""

    def __init__(self, read: Callable[[], Iterator[pa.RecordBatch]], columns: tuple[str, ...]) -> None:
        """Reads nothing yet.

        Args:
            read: Gives the table from its beginning.
            columns: Whose values name a run.
        """
        self._read = read
        self._columns = columns
        self._runs: Iterator[tuple[_Key, list[pa.RecordBatch]]] = iter(())
        self._last: tuple[_Key, list[pa.RecordBatch]] | None = None

    def of(self, *key: object) -> list[pa.RecordBatch]:
        """Returns the rows of that key; none if there are none."""
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        return self._search(key) or self._search_from_beginning(key)

    def _search_from_beginning(self, key: _Key) -> list[pa.RecordBatch]:
        self._runs = _runs(self._read(), self._columns)
        return self._search(key)

    def _search(self, key: _Key) -> list[pa.RecordBatch]:
        for run in self._runs:
            self._last = run
            if run[0] == key:
                return run[1]
        return []


def _runs(
    batches: Iterator[pa.RecordBatch], columns: tuple[str, ...]
) -> Iterator[tuple[_Key, list[pa.RecordBatch]]]:
    """Gives rows that stand together and have the same key, which may go on from one batch to the next."""
    current: _Key | None = None
    together: list[pa.RecordBatch] = []
    for batch in batches:
        for key, part in _parts(batch, columns):
            if key != current and together:
                assert current is not None, "what stands together has a key"
                yield current, together
                together = []
            current = key
            together.append(part)
    if current is not None:
        yield current, together


def _parts(batch: pa.RecordBatch, columns: tuple[str, ...]) -> Iterator[tuple[_Key, pa.RecordBatch]]:
    keys = list(zip(*(batch[name].to_pylist() for name in columns), strict=True))
    start = 0
    for i in range(1, len(keys) + 1):
        if i == len(keys) or keys[i] != keys[start]:
            yield keys[start], batch.slice(start, i - start)
            start = i
