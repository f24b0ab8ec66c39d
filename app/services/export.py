"""Everything that was recorded, as tidy tables: one row a person, step, response, query, answer, posterior, event."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import fields
from itertools import zip_longest
from pathlib import Path
from typing import Literal

from app.errors import AppError
from app.services.table import Format, Row, Table
from app.store import (
    EventRecord,
    ExternalPerson,
    MeasureRecord,
    PosteriorRecord,
    SessionRecord,
    Source,
    Store,
)
from study_core import session_codec
from study_core.comparison import Choice
from study_core.events import AnswerGiven, AnswerTakenBack, Event, QueryPrepared, StepTaken
from study_core.path import questionnaire_of
from study_core.plan import position_of
from study_core.queries import Imported, Provenance
from study_core.session import SessionState, reduce
from study_core.study import Study, parse_study

People = Literal["real", "rehearsed", "imported", "all"]

# A table's rows have the same columns, whether a query was computed here or imported.
_NO_PROVENANCE: Row = {
    **{field.name: None for kind in (Provenance, Imported) for field in fields(kind)},
    "method": Imported.method,
    "has_converged": [None, None],
}


# The first logs ever kept say nothing of them.
_NO_PLACE: Row = {"first_shown": None, "repeat_of": None, "instructed": None, "machine": None}

_MEASURES = (
    *("replays", "pauses", "speed_changes", "scrubs", "hidden", "out_of_focus_ms"),
    *("means", "confidence_time_ms", "first_frame", "frame_ms", "stage_frame_ms"),
    *("layout", "viewport", "device_pixel_ratio"),
)
"""What browsers measure; whatever else one may have sent is in `other`."""

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
    log = tuple(session_codec.from_json(event.kind, event.payload) for event in events)
    yield "people", _person_row(record, study, reduce(study, log), store.external_person(record.id))
    withdrawn = _withdrawn(log)
    sides: dict[int, Choice | None] = {}
    for row, event in zip(events, log, strict=True):
        stands = {"is_taken_back": row.position in withdrawn}
        yield "events", _event_row(record, row)
        if isinstance(event, StepTaken):
            yield "steps", _step_row(record, study, row, event)
            yield from (("responses", each) for each in _response_rows(record, study, row, event))
        elif isinstance(event, QueryPrepared):
            sides[event.query_index] = event.first_shown
            yield "queries", _query_row(record, study, row) | stands
        elif isinstance(event, AnswerGiven):
            yield "answers", _answer_row(record, row, event, sides[event.query_index]) | stands
    for measured in store.measures(record.id):
        yield "measures", _measure_row(record, measured)
    for posterior in store.posteriors(record.id):
        yield "posteriors", _posterior_row(record, study, posterior)


def _withdrawn(log: tuple[Event, ...]) -> set[int]:
    """Returns the positions of answers that were taken back, and of the queries that had been prepared after them."""
    withdrawn: set[int] = set()
    for end, event in enumerate(log):
        if isinstance(event, AnswerTakenBack):
            before = reversed(range(end))
            answer = next(i for i in before if isinstance(log[i], AnswerGiven) and i not in withdrawn)
            queries = (i for i in range(answer, end) if isinstance(log[i], QueryPrepared))
            withdrawn |= {answer, *queries}
    return withdrawn


def _person_row(
    record: SessionRecord, study: Study, state: SessionState, person: ExternalPerson | None
) -> Row:
    asked = list(zip(state.prepared, state.answers, strict=False))
    repeats = [
        given.choice is state.answers[query.repeat_of].choice
        for query, given in asked
        if query.repeat_of is not None
    ]
    checks = [
        position_of(query.first_shown, given.choice) is query.instructed
        for query, given in asked
        if query.instructed is not None
    ]
    return {
        "person_id": record.id,
        "study": study.name,
        "study_hash": record.study_hash,
        "ordinal": record.ordinal,
        "source": record.source.value,
        "created_at": record.created_at.isoformat(),
        "language": state.language or study.languages[0],
        "n_answers": len(state.answers),
        "is_finished": len(state.answers) == study.n_queries,
        "ending": state.ending,
        "n_repeats": len(repeats),
        "n_repeats_agreed": sum(repeats),
        "n_checks": len(checks),
        "n_checks_passed": sum(checks),
        "external_id": None if person is None else person.external_id,
        "other_ids": {} if person is None else person.other_ids,
    }


def _step_row(record: SessionRecord, study: Study, row: EventRecord, event: StepTaken) -> Row:
    read = event.content.get("read", {})
    return {
        "person_id": record.id,
        "position": row.position,
        "step": event.step,
        "kind": study.file.path[event.step].step,
        "outcome": event.outcome,
        "language": read.get("language"),
        "text_sha256": read.get("text_sha256"),
        "at": row.at.isoformat(),
    }


def _response_rows(record: SessionRecord, study: Study, row: EventRecord, event: StepTaken) -> Iterator[Row]:
    answers, questionnaire = event.content.get("answers"), questionnaire_of(study.file.path[event.step])
    if answers is None or questionnaire is None:
        return
    for item in study.file.questionnaire[questionnaire]:
        yield {
            "person_id": record.id,
            "position": row.position,
            "step": event.step,
            "questionnaire": questionnaire,
            "item": item.name,
            "value": answers[item.name],
        }


def _answer_row(
    record: SessionRecord, row: EventRecord, event: AnswerGiven, first_shown: Choice | None
) -> Row:
    return {
        "person_id": record.id,
        "query_index": event.query_index,
        "choice": event.choice,
        "position_chosen": position_of(first_shown, event.choice),
        "response_time_ms": event.response_time_ms,
        "confidence": event.confidence,
        "answered_at": row.at.isoformat(),
    }


def _measure_row(record: SessionRecord, measured: MeasureRecord) -> Row:
    # Nobody vouches for what a browser sends; a value of another form must not change the table's.
    known = {key: value for key, value in measured.measures.items() if _is_measure(key, value)}
    other = {key: value for key, value in measured.measures.items() if key not in known}
    return {
        "person_id": record.id,
        "query_index": measured.query_index,
        "received_at": measured.at.isoformat(),
        **dict.fromkeys(_MEASURES),
        **known,
        "other": other,
    }


def _is_measure(key: str, value: object) -> bool:
    return key in _MEASURES and (key == "viewport" or not isinstance(value, (dict, list)))


def _event_row(record: SessionRecord, event: EventRecord) -> Row:
    return {
        "person_id": record.id,
        "position": event.position,
        "kind": event.kind,
        "at": event.at.isoformat(),
        "payload": event.payload,
    }


def _query_row(record: SessionRecord, study: Study, event: EventRecord) -> Row:
    content = {**_NO_PLACE, **event.payload}
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
