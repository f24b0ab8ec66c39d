"""Everything that was recorded, as tidy tables: one row a person, query, answer, posterior, event."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import fields
from itertools import zip_longest
from pathlib import Path
from typing import Literal

from app.errors import AppError
from app.services.table import Format, Row, Table
from app.store import EventRecord, PosteriorRecord, SessionRecord, Source, Store
from study_core.queries import Imported, Provenance
from study_core.study import Study, parse_study

People = Literal["real", "rehearsed", "imported", "all"]

# A table's rows have the same columns, whether a query was computed here or imported.
_NO_PROVENANCE: Row = {
    **{field.name: None for kind in (Provenance, Imported) for field in fields(kind)},
    "method": Imported.method,
    "has_converged": [None, None],
}


_SOURCES = {"real": Source.JOINED, "rehearsed": Source.REHEARSED, "imported": Source.IMPORTED}


class ExportError(AppError):
    """An export that can't be written, or would hold nothing."""


def export(store: Store, folder: Path, form: Format, people: People, on_person: Callable[[], None]) -> int:
    """Writes all tables and the study files into a new folder.

    Args:
        store: Where the answers are.
        folder: Must not exist, or be empty.
        form: `csv`, where lists become numbered or named columns, or `jsonl`.
        people: Real ones, who joined here, rehearsed or imported ones, or all.
        on_person: Called after each person.

    Returns:
        How many people were written.

    Raises:
        ExportError: There is nobody to export, or the folder can't be used.
    """
    sessions = [record for record in store.sessions() if _is_wanted(record, people)]
    if not sessions:
        whom, hint = ("anybody", "") if people == "all" else (f"{people} people", " Try --people all.")
        raise ExportError(f"Expected {whom} to export, found nobody. Has anyone begun?{hint}")
    _make_empty(folder)
    with ExitStack() as stack:
        tables: dict[str, Table] = {}
        for record in sessions:
            study = parse_study(store.study_text(record.study_hash))
            _write_study(folder, study)
            for name, row in _rows(store, record, study):
                if name not in tables:
                    path = folder / f"{name}.{form}"
                    tables[name] = Table(
                        stack.enter_context(path.open("w", encoding="utf-8", newline="")), form
                    )
                tables[name].write(row)
            on_person()
    return len(sessions)


def _is_wanted(record: SessionRecord, people: People) -> bool:
    return people == "all" or record.source is _SOURCES[people]


def _make_empty(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ExportError(f"{folder} is not empty. Name a new folder; exports never overwrite.")
        (folder / "studies").mkdir()
    except OSError as error:
        raise ExportError(f"Can't write to {folder}: {error.strerror}. Name another folder.") from error


def _write_study(folder: Path, study: Study) -> None:
    path = folder / "studies" / f"{study.hash}.toml"
    if not path.exists():
        path.write_text(study.text, encoding="utf-8")


def _rows(store: Store, record: SessionRecord, study: Study) -> Iterator[tuple[str, Row]]:
    """Gives every row of one person, with the name of its table."""
    events = store.events(record.id)
    yield "people", _person_row(store, record, study)
    for event in events:
        yield "events", _event_row(record, event)
        if event.kind == "query_prepared":
            yield "queries", _query_row(record, study, event)
        elif event.kind == "answer_given":
            yield "answers", {"person_id": record.id, **event.payload, "answered_at": event.at.isoformat()}
    for posterior in store.posteriors(record.id):
        yield "posteriors", _posterior_row(record, study, posterior)


def _person_row(store: Store, record: SessionRecord, study: Study) -> Row:
    n_answers, person = store.n_answers(record.id), store.external_person(record.id)
    return {
        "person_id": record.id,
        "study": study.name,
        "study_hash": record.study_hash,
        "ordinal": record.ordinal,
        "source": record.source.value,
        "created_at": record.created_at.isoformat(),
        "n_answers": n_answers,
        "is_finished": n_answers == study.n_queries,
        "ending": store.ending(record.id),
        "external_id": None if person is None else person.external_id,
        "other_ids": {} if person is None else person.other_ids,
    }


def _event_row(record: SessionRecord, event: EventRecord) -> Row:
    return {
        "person_id": record.id,
        "position": event.position,
        "kind": event.kind,
        "at": event.at.isoformat(),
        "payload": event.payload,
    }


def _query_row(record: SessionRecord, study: Study, event: EventRecord) -> Row:
    content = event.payload
    query, provenance = content["query"], {**_NO_PROVENANCE, **content["provenance"]}
    names = study.domain.feature_names
    named = {key: dict(zip(names, query[key], strict=True)) for key in ("features_a", "features_b")}
    weights = {key: _by_weight(study, provenance[key] or []) for key in ("weights_a", "weights_b")}
    return {
        "person_id": record.id,
        **{key: value for key, value in content.items() if key not in ("query", "provenance")},
        **query,
        **named,
        **provenance,
        **weights,
        "prepared_at": event.at.isoformat(),
    }


def _posterior_row(record: SessionRecord, study: Study, posterior: PosteriorRecord) -> Row:
    n_weights = len(posterior.mean)
    per_quantity = {
        key: _by_weight(study, posterior.summary[key][:n_weights])
        | dict(zip(study.response.inferred, posterior.summary[key][n_weights:], strict=True))
        for key in ("r_hat", "ess_bulk", "ess_tail")
    }
    return {
        "person_id": record.id,
        "query_index": posterior.query_index,
        "mean": _by_weight(study, posterior.mean.tolist()),
        **posterior.summary,
        **per_quantity,
    }


def _by_weight(study: Study, values: list[float | None]) -> Row:
    """Returns a value for each weight that a posterior of the study may have; None where this one has none (yet)."""
    return dict(zip_longest(study.weight_names, values))
