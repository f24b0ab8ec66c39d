"""One table in a file of its own, for whatever isn't a whole export."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from app.services.export.blocks import Blocks
from app.services.export.columns import Row, TableSchema
from app.services.export.errors import ExportError
from app.services.export.files import new_file
from app.services.export.layout import FileForm
from app.services.export.values import batch_of

_FORMS: dict[str, FileForm] = {".csv": "csv", ".parquet": "parquet", ".jsonl": "jsonl"}


@contextmanager
def new_table(path: Path, table: TableSchema) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Opens a new file for a table, of the form that its name ends in; gives what adds rows.

    Raises:
        ExportError: The name ends otherwise, the file exists, or it can't be written.
    """
    form = _FORMS.get(path.suffix)
    if form is None:
        *others, last = _FORMS
        raise ExportError(
            f"Expected a file name that ends in {', '.join(others)} or {last}, got {path}. Name it so."
        )
    blocks = Blocks(table.block)
    try:
        with new_file(path, form, table) as write:

            def add(rows: Sequence[Row]) -> None:
                for block in blocks.add(batch_of(table, rows)):
                    write(block)

            try:
                yield add
            finally:
                # What was added stays, whatever happens to whoever adds.
                for block in blocks.rest():
                    write(block)
    except OSError as error:
        raise ExportError(f"Can't write {path}: {error.strerror or error}. Name a new file.") from error
