"""Rows as they come, a person's at a time, put together into blocks of a fixed number of rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import pyarrow as pa


class Blocks:
    """Takes batches of any length and gives them back as blocks of one; holds less than a block and a batch."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._waiting: list[pa.RecordBatch] = []
        self._n_waiting = 0

    def add(self, batch: pa.RecordBatch) -> Iterator[pa.RecordBatch]:
        """Takes some rows; gives the blocks that are now full."""
        self._waiting.append(batch)
        self._n_waiting += batch.num_rows
        if self._n_waiting < self._size:
            return
        together = pa.concat_batches(self._waiting)
        n_full = self._n_waiting - self._n_waiting % self._size
        for start in range(0, n_full, self._size):
            yield together.slice(start, self._size)
        self._waiting = [together.slice(n_full)]
        self._n_waiting -= n_full

    def rest(self) -> Iterator[pa.RecordBatch]:
        """Gives what is left, if anything is."""
        if self._n_waiting:
            yield pa.concat_batches(self._waiting)
        self._waiting, self._n_waiting = [], 0


def in_blocks(batches: Iterable[pa.RecordBatch], size: int) -> Iterator[pa.RecordBatch]:
    """Gives the same rows in blocks of `size`, the last one shorter."""
    blocks = Blocks(size)
    for batch in batches:
        yield from blocks.add(batch)
    yield from blocks.rest()
