"""Writing an export: one pass over the people, each read at one moment, whatever the study does meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pyarrow as pa

from app.services.export.columns import Row, TableSchema
from app.services.export.description import write_description
from app.services.export.errors import ExportError
from app.services.export.folder import new_folder
from app.services.export.layout import materials, table_path
from app.services.export.manifest import Manifest, file_digest
from app.services.export.materials import ClipBuilder, write_clips, write_model, write_study
from app.services.export.open_table import OpenTable, open_table
from app.services.export.options import SOURCES, ExportOptions, Samples
from app.services.export.pseudonyms import Pseudonyms, new_key_file
from app.services.export.rows import network_row, person_rows
from app.services.export.tables import QUANTITIES, tables_of
from app.services.export.values import batch_of
from app.store import PersonRecord, SessionDeletedError, SessionRecord, Store
from study_core.study import Study, parse_study


def export(
    store: Store,
    folder: Path,
    options: ExportOptions,
    on_person: Callable[[int, int], None] = lambda done, total: None,
    build_clips: ClipBuilder | None = None,
) -> int:
    """Writes an export into a new folder: all of it, or nothing.

    Args:
        store: Where the answers are; others may be writing to it.
        folder: Must not exist, or be empty.
        options: What is written.
        on_person: Called after each person, with how many are done and how many there are.
        build_clips: Builds the clips that people saw, if they are wanted; they are many, and take a while.

    Returns:
        How many people were written.

    Raises:
        ExportError: There is nobody to export, or something can't be written.
    """
    chosen = _chosen(store, options)
    with new_folder(folder) as unfinished, ExitStack() as stack:
        pseudonyms = stack.enter_context(_pseudonyms(options, folder))
        export = _Export(store, unfinished, options, build_clips, pseudonyms)
        return export.write(chosen, on_person)


def _chosen(store: Store, options: ExportOptions) -> list[SessionRecord]:
    """Returns whose sessions are exported, oldest first."""
    records = store.sessions() if options.study is None else store.sessions_of_study_named(options.study)
    chosen = [each for each in records if options.people == "all" or each.source is SOURCES[options.people]]
    if chosen:
        return chosen
    names = {each.name for each in store.studies()}
    if options.study is not None and options.study not in names:
        raise ExportError(
            f"Expected the name of a study, got '{options.study}'. Here are: {', '.join(sorted(names)) or 'none'}."
        )
    whom = "anybody" if options.people == "all" else f"{options.people} people"
    others = sorted({each.source.value for each in records})
    hint = f" There are {' and '.join(others)} people." if others else " Has anyone begun?"
    of_study = "" if options.study is None else f" of the study '{options.study}'"
    raise ExportError(f"Expected {whom}{of_study} to export, found nobody.{hint}")


@contextmanager
def _pseudonyms(options: ExportOptions, folder: Path) -> Iterator[Pseudonyms | None]:
    if not options.has_pseudonyms:
        yield None
    elif options.key_file is None:
        yield Pseudonyms(lambda *row: None, options.keeps_times)
    else:
        with new_key_file(options.key_file, folder) as write_key:
            yield Pseudonyms(write_key, options.keeps_times)


class _Export:
    """An export that is being written."""

    def __init__(
        self,
        store: Store,
        folder: Path,
        options: ExportOptions,
        build_clips: ClipBuilder | None,
        pseudonyms: Pseudonyms | None,
    ) -> None:
        self._store = store
        self._folder = folder
        self._materials = folder / materials(options.form)
        self._options = options
        self._build_clips = build_clips
        self._pseudonyms = pseudonyms

    def write(self, chosen: Sequence[SessionRecord], on_person: Callable[[int, int], None]) -> int:
        """Writes everything; returns how many people were written."""
        studies = self._studies(chosen)
        schemas = tables_of(studies.values(), self._options.samples != "none")
        n_written = 0
        with ExitStack() as stack:
            tables = {
                schema.name: stack.enter_context(open_table(self._folder, self._options.form, schema))
                for schema in schemas
            }
            for done, record in enumerate(chosen, start=1):
                n_written += self._write_person(tables, studies[record.study_hash], record.id)
                on_person(done, len(chosen))
            self._write_shared_models(tables, {study.name for study in studies.values()})
        write_description(self._folder, self._options.form, schemas, tuple(studies.values()))
        self._write_manifest(tables)
        return n_written

    def _studies(self, chosen: Sequence[SessionRecord]) -> dict[str, Study]:
        hashes = dict.fromkeys(record.study_hash for record in chosen)
        studies = {each: parse_study(self._store.study_text(each)) for each in hashes}
        for study in studies.values():
            write_study(self._materials, study)
        return studies

    def _write_person(self, tables: dict[str, OpenTable], study: Study, session_id: str) -> bool:
        """Writes a person's rows; returns whether they are still there."""
        try:
            person = self._store.person(session_id)
        except SessionDeletedError:
            return False
        if self._pseudonyms is not None:
            person = self._pseudonyms.of(person)
        rows: dict[str, list[Row]] = {}
        for name, row in person_rows(study, person):
            rows.setdefault(name, []).append(row)
        for name, some in rows.items():
            tables[name].add(batch_of(tables[name].schema, some))
        if "samples" in tables:
            for batch in _samples(tables["samples"].schema, study, person, self._options.samples):
                tables["samples"].add(batch)
        for model in person.models:
            write_model(self._materials, model)
        if self._build_clips is not None:
            write_clips(self._materials, study, person.events, self._build_clips)
        return True

    def _write_shared_models(self, tables: dict[str, OpenTable], names: set[str]) -> None:
        for name in sorted(names):
            for model in self._store.shared_models(name):
                told = model if self._pseudonyms is None else self._pseudonyms.of_model(model)
                networks = tables["networks"]
                networks.add(batch_of(networks.schema, [network_row(name, told)]))
                write_model(self._materials, told)

    def _write_manifest(self, tables: dict[str, OpenTable]) -> None:
        own = {table_path(self._options.form, name) for name in tables}
        paths = sorted(path for path in self._folder.rglob("*") if path.is_file())
        files = {path.relative_to(self._folder).as_posix(): path for path in paths}
        manifest = Manifest(
            self._options.form,
            version("prefstudy"),
            {name: table.schema for name, table in tables.items()},
            {name: table.digest.n_rows for name, table in tables.items()},
            {name: table.digest.hexdigest() for name, table in tables.items()},
            {name: file_digest(path) for name, path in files.items() if name not in own},
        )
        manifest.write(self._folder)


def _samples(
    schema: TableSchema, study: Study, person: PersonRecord, which: Samples
) -> Iterator[pa.RecordBatch]:
    """Gives the samples of the wanted posteriors, as columns: there may be millions."""
    posteriors = person.posteriors if which == "all" else person.posteriors[-1:]
    for posterior in posteriors:
        n_samples, n_weights = posterior.samples.shape
        columns = {
            "person_id": pa.repeat(person.session.id, n_samples),
            "query_index": pa.array(np.full(n_samples, posterior.query_index)),
            "sample": pa.array(np.arange(n_samples)),
        }
        for i, name in enumerate(study.weight_names[:n_weights]):
            columns[f"sample_{name}"] = pa.array(np.ascontiguousarray(posterior.samples[:, i]))
        if posterior.parameters is not None:
            of_each = zip(QUANTITIES, posterior.parameters.T, strict=True)
            columns |= {name: pa.array(np.ascontiguousarray(values)) for name, values in of_each}
        absent = (name for name in schema.names if name not in columns)
        columns |= {name: pa.nulls(n_samples, pa.float64()) for name in absent}
        yield pa.record_batch([columns[name] for name in schema.names], schema=schema.arrow)
