"""How fast exports are written, and how much memory that takes, against holding everything and writing it plainly."""

from __future__ import annotations

import csv
import json
import multiprocessing
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pyarrow as pa
import pyarrow.parquet
from rich.progress import Progress

import app.process  # noqa: F401  - before numpy, in a process of its own as well
from app import wiring
from app.bench.report import BenchError, figures, provenance
from app.services.export import ExportOptions, export, open_export
from app.services.export.columns import Row, TableSchema
from app.services.export.layout import Form
from app.services.export.rows import person_rows
from app.services.export.tables import tables_of
from app.services.export.values import batch_of, canonical_json
from app.services.rehearsal import rehearse
from app.services.rehearsed_person import Crowd
from app.settings import find_study
from app.store import ImportedSession, NewEvent, open_store
from study_core.study import Study, parse_study

_FORMS: tuple[Form, ...] = ("csv", "parquet", "jsonl")
_N_ACTIVE, _N_TEST = 150, 25


def run(seed: int, people: int, progress: Progress) -> dict[str, Any]:
    """Exports a database of many people in every form, and a quarter of them.

    The people are one simulated person's session of 175 answers, log and posteriors, kept again under other ids: what
    an export does with a row doesn't depend on whose it is. Each export runs in a process of its own, whose peak memory
    is its own. Neither way writes samples; the plain one has no digests either.

    Args:
        seed: Of the simulated person.
        people: How many, at least 4.
        progress: Shows how far it is.

    Returns:
        Rows a second and peak memory of each form, as ratios to the plain way as well, and where it was measured.

    Raises:
        BenchError: There are too few people.
    """
    if people < 4:
        raise BenchError(
            f"Expected at least 4 people, got {people}: memory is compared with a quarter of them."
        )
    with TemporaryDirectory(prefix="prefstudy-bench-") as folder:
        many, few = f"sqlite:///{folder}/many.db", f"sqlite:///{folder}/few.db"
        task = progress.add_task("people", total=people + people // 4)
        session = _session(seed)
        for database, n_people in ((many, people), (few, people // 4)):
            _fill(database, session, n_people, lambda: progress.advance(task))
        task = progress.add_task("exports", total=3 * len(_FORMS))
        forms: dict[str, Any] = {}
        for form in _FORMS:
            forms[form] = _compare(many, few, form, Path(folder))
            progress.advance(task, 3)
    return {
        "people": people,
        "answers": _N_ACTIVE + _N_TEST,
        **forms,
        **provenance(seed, ["pyarrow", "msgspec"]),
    }


def _compare(many: str, few: str, form: Form, folder: Path) -> dict[str, Any]:
    ours = _apart(_export, many, form, folder / f"{form}-many")
    fewer = _apart(_export, few, form, folder / f"{form}-few")
    plain = _apart(_write_plainly, many, form, folder / f"{form}-plain")
    return {
        "rows": ours["rows"],
        "rows_per_s": figures(ours["rows"] / ours["seconds"]),
        "peak_mb": figures(ours["peak_mb"]),
        "peak_ratio_to_a_quarter": figures(ours["peak_mb"] / fewer["peak_mb"]),
        "plain_rows_per_s": figures(plain["rows"] / plain["seconds"]),
        "plain_peak_mb": figures(plain["peak_mb"]),
        "speed_ratio_to_plain": figures(ours["rows"] / ours["seconds"] / (plain["rows"] / plain["seconds"])),
        "peak_ratio_to_plain": figures(ours["peak_mb"] / plain["peak_mb"]),
    }


def _session(seed: int) -> ImportedSession:
    """Returns what a simulated person left behind, to be kept again."""
    text = find_study("quickstart").text
    for key, number in (("active_queries = 8 ", _N_ACTIVE), ("test_queries = 4 ", _N_TEST)):
        assert key in text, "the study that ships has these numbers"
        text = text.replace(key, f"{key.partition('=')[0]}= {number} ")
    study = parse_study(text)
    with wiring.headless() as runtime:
        rehearse(runtime, study, Crowd(seed, 1), 1, lambda: None)
        (record,) = runtime.store.sessions()
        events = tuple(NewEvent(each.kind, each.payload) for each in runtime.store.events(record.id))
        posteriors = runtime.store.posteriors(record.id)
    return ImportedSession("0", study.hash, study.name, study.text, events, posteriors)


def _fill(database: str, session: ImportedSession, n_people: int, on_person: Callable[[], None]) -> None:
    with open_store(database) as store:
        for number in range(n_people):
            store.add_imported(
                ImportedSession(
                    f"{number:064x}",
                    session.study_hash,
                    session.study_name,
                    session.study_text,
                    session.events,
                    session.posteriors,
                )
            )
            on_person()


def _apart(
    function: Callable[[str, Form, Path], int], database: str, form: Form, folder: Path
) -> dict[str, Any]:
    """Runs an export in a new process; returns its rows, seconds and peak memory."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_measured, function, database, form, folder).result()


def _measured(
    function: Callable[[str, Form, Path], int], database: str, form: Form, folder: Path
) -> dict[str, Any]:
    started = time.perf_counter()
    n_rows = function(database, form, folder)
    seconds = time.perf_counter() - started
    return {"rows": n_rows, "seconds": seconds, "peak_mb": _peak_mb()}


def _peak_mb() -> float:
    """Returns the most memory that this process has held."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    # Not what `getrusage` says: on Linux that begins with what the process held from which this one was started.
    (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) / 1024


def _export(database: str, form: Form, folder: Path) -> int:
    with open_store(database) as store:
        export(store, folder, ExportOptions(form, "imported", samples="none"))
    return sum(open_export(folder).manifest.n_rows.values())


def _write_plainly(database: str, form: Form, folder: Path) -> int:
    """Reads everybody, then writes table by table with what Python and Arrow have for that."""
    folder.mkdir()
    rows: dict[str, list[Row]] = {}
    with open_store(database) as store:
        studies: dict[str, Study] = {}
        for record in store.sessions():
            study = studies.setdefault(record.study_hash, parse_study(store.study_text(record.study_hash)))
            for name, row in person_rows(study, store.person(record.id)):
                rows.setdefault(name, []).append(row)
    for table in tables_of(studies.values(), with_samples=False):
        _write_one(folder / f"{table.name}.{form}", form, table, rows.get(table.name, []))
    return sum(len(some) for some in rows.values())


def _write_one(path: Path, form: Form, table: TableSchema, rows: list[Row]) -> None:
    if form == "parquet":
        pyarrow.parquet.write_table(pa.Table.from_batches([batch_of(table, rows)]), path, compression="zstd")
        return
    with path.open("w", encoding="utf-8", newline="") as file:
        if form == "jsonl":
            file.writelines(json.dumps(row, default=str) + "\n" for row in rows)
            return
        writer = csv.DictWriter(file, table.names)
        writer.writeheader()
        in_one_cell = [column.name for column in table.columns if column.kind == "json"]
        writer.writerows(row | {name: canonical_json(row.get(name)) for name in in_one_cell} for row in rows)
