"""Rows of one person, or of one query, in a table whose rows stand in everybody's order."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pyarrow as pa

_Key = tuple[object, ...]
_Place = tuple[int, ...]
_Run = tuple[_Key, list[pa.RecordBatch]]

_BEFORE_ALL: _Place = ()


class Runs:
    """Finds rows that stand together. Whoever asks in the table's order has it read once, and never kept."""

    def __init__(
        self,
        read: Callable[[], Iterator[pa.RecordBatch]],
        columns: tuple[str, ...],
        place_of: Callable[[_Key], _Place],
    ) -> None:
        """Reads nothing yet.

        Args:
            read: Gives the table from its beginning.
            columns: Whose values name a run.
            place_of: Where a run stands in the table, should there be one, compared with others.
        """
        self._read = read
        self._columns = columns
        self._place_of = place_of
        self._runs: Iterator[_Run] = iter(())
        self._head: _Run | None = None
        # Nothing has been read yet, so whatever is asked for may have been passed.
        self._passed: _Place | None = None

    def of(self, *key: object) -> list[pa.RecordBatch]:
        """Returns the rows of that key; none if there are none."""
        wanted = self._place_of(key)
        if self._passed is None or wanted <= self._passed:
            self._runs, self._passed = _runs(self._read(), self._columns), _BEFORE_ALL
            self._head = next(self._runs, None)
        while self._head is not None and self._place_of(self._head[0]) < wanted:
            self._passed = self._place_of(self._head[0])
            self._head = next(self._runs, None)
        return self._head[1] if self._head is not None and self._head[0] == key else []


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
