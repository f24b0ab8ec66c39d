"""Reading an export, whatever its form: the same typed rows from CSV, Parquet, JSON Lines and Psych-DS."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import Float

from app.services.export.blocks import in_blocks
from app.services.export.checking import check
from app.services.export.columns import Row, TableSchema
from app.services.export.digests import Edges
from app.services.export.errors import ExportDifferenceError, ExportError
from app.services.export.files import batches_in
from app.services.export.layout import digests_path, file_form, materials, table_path
from app.services.export.manifest import Manifest, read_manifest
from app.services.export.runs import Runs
from app.services.export.tables import QUANTITIES
from app.services.export.values import rows_of
from study_core.errors import StudyError
from study_core.study import Study, parse_study


def open_export(folder: Path) -> Export:
    """Opens an exported folder.

    Raises:
        ExportError: It is none, is damaged, or a later version wrote it; the message says what to do.
    """
    if not folder.is_dir():
        raise ExportError(f"Expected the folder of an export, found none at {folder}. Name one.")
    export = Export(folder, read_manifest(folder))
    for name in export.tables:
        if not export.path_of(name).is_file():
            raise ExportError(f"Expected the table {export.path_of(name)}, found none. Export again.")
    return export


class Export:
    """An exported folder, open for reading. Its rows are read when they are asked for, and again each time."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        """Wraps a folder; use `open_export`.

        Args:
            folder: Of the export.
            manifest: The one in it.
        """
        self.folder = folder
        self.manifest = manifest
        self._studies: dict[str, Study] = {}
        self._runs: dict[str, Runs] = {}

    @property
    def tables(self) -> tuple[str, ...]:
        """Returns the tables' names."""
        return tuple(self.manifest.tables)

    def path_of(self, table: str) -> Path:
        """Returns a table's file."""
        return self.folder / table_path(self.manifest.form, table)

    def study(self, study_hash: str) -> Study:
        """Returns the study of that hash.

        Raises:
            ExportError: Its file is missing, or isn't what was exported.
        """
        if study_hash not in self._studies:
            self._studies[study_hash] = self._read_study(study_hash)
        return self._studies[study_hash]

    def people(self) -> list[Row]:
        """Returns the rows of the table `people`, in the order in which everybody's rows stand in every table."""
        return list(self.rows("people"))

    def rows(self, table: str) -> Iterator[Row]:
        """Gives a table's rows: timestamps aware, JSON as values, None for nothing.

        Raises:
            ExportError: There is no such table in this export, or it can't be read.
        """
        schema = self._schema(table)
        for batch in self._batches(schema):
            yield from rows_of(schema, batch)

    def events(self, person_id: str) -> list[Row]:
        """Returns a person's log. It is quick when people are asked for in the order of `people`."""
        return self.rows_of("events", person_id)

    def rows_of(self, table: str, person_id: str) -> list[Row]:
        """Returns a person's rows of a table. It is quick when people are asked for in the order of `people`."""
        schema = self._schema(table)
        if table not in self._runs:
            self._runs[table] = Runs(lambda: self._batches(schema), ("person_id",), self._place_of)
        return [row for batch in self._runs[table].of(person_id) for row in rows_of(schema, batch)]

    def samples(self, person_id: str, query_index: int) -> Float[np.ndarray, "n_samples n_weights"]:
        """Returns the samples of a posterior; none if they weren't exported.

        It is quick in the order of `people` and of the queries.
        """
        return self._of_samples(person_id, query_index, lambda name: name.startswith("sample_"))

    def parameters(self, person_id: str, query_index: int) -> Float[np.ndarray, "n_samples 3"] | None:
        """Returns the response parameters of each of these samples; None where they don't differ."""
        known = self._of_samples(person_id, query_index, lambda name: name in QUANTITIES)
        return known if known.size else None

    def _of_samples(
        self, person_id: str, query_index: int, is_wanted: Callable[[str], bool]
    ) -> Float[np.ndarray, "n_samples n_columns"]:
        """Returns the columns of a posterior's samples that have a value in every row."""
        if "samples" not in self.manifest.tables:
            return np.empty((0, 0))
        batches = self._posteriors.of(person_id, query_index)
        if not batches:
            return np.empty((0, 0))
        together = pa.concat_batches(batches)
        columns = [together[name] for name in together.schema.names if is_wanted(name)]
        known = [column.to_numpy() for column in columns if column.null_count == 0]
        return np.stack(known, axis=1) if known else np.empty((len(together), 0))

    def check_digests(self, on_row: Callable[[int], None] = lambda n_rows: None) -> None:
        """Compares every row with the digests that were written with it.

        Args:
            on_row: Called with each number of rows that were just compared.

        Raises:
            ExportDifferenceError: Something was changed, added or taken away; the message names the first row, its
                person and query, the column and the value that stands there now.
        """
        check(self, on_row)

    def edges(self, table: str) -> Iterator[Edges]:
        """Gives the digests that were written with each block of a table's rows."""
        path = self.folder / digests_path(table)
        try:
            with path.open(encoding="utf-8") as lines:
                for line in lines:
                    yield Edges(**json.loads(line))
        except (OSError, ValueError, TypeError) as error:
            raise ExportError(f"Can't read the digests {path}: {error}. Export again.") from error

    def blocks(self, table: str) -> Iterator[pa.RecordBatch]:
        """Gives a table's rows as columns, in the blocks that have digests."""
        schema = self._schema(table)
        return in_blocks(self._batches(schema), schema.block)

    def _schema(self, table: str) -> TableSchema:
        if table not in self.manifest.tables:
            raise ExportError(
                f"{self.folder} has no table '{table}', but {', '.join(self.tables)}. Export again with it."
            )
        return self.manifest.tables[table]

    def _batches(self, schema: TableSchema) -> Iterator[pa.RecordBatch]:
        path = self.path_of(schema.name)
        try:
            yield from batches_in(path, file_form(self.manifest.form), schema)
        except (OSError, ValueError, pa.ArrowException) as error:
            told = " ".join(str(error).split())
            raise ExportDifferenceError(f"{path} isn't what was exported: {told}. Export again.") from error

    @cached_property
    def _posteriors(self) -> Runs:
        columns = ("person_id", "query_index")
        return Runs(lambda: self._batches(self._schema("samples")), columns, self._place_of)

    @cached_property
    def _places(self) -> dict[str, int]:
        return {row["person_id"]: place for place, row in enumerate(self.rows("people"))}

    def _place_of(self, key: tuple[Any, ...]) -> tuple[int, ...]:
        """Returns where the rows of a person, or of a query of theirs, stand in every table; nobody's at the end."""
        return (self._places.get(key[0], len(self._places)), *key[1:])

    def _read_study(self, study_hash: str) -> Study:
        path = self.folder / materials(self.manifest.form) / "studies" / f"{study_hash}.toml"
        try:
            content = path.read_bytes()
        except OSError as error:
            raise ExportError(f"Can't read {path}: {error.strerror}. Export again.") from error
        found = hashlib.sha256(content).hexdigest()
        if found != study_hash:
            raise ExportError(f"{path} was changed after the export: its hash is {found}. Export again.")
        try:
            return parse_study(content.decode())
        except StudyError as error:
            raise ExportError(
                f"{path}: {error} This version can't read it. Install the release that exported it: "
                f"prefstudy=={self.manifest.code_version}, with its plug-ins."
            ) from error
