"""A person's rows of every table, from what is kept of them: pure functions, the same when an export is checked."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Any

from app.services.export.columns import Row
from app.services.export.tables import DIAGNOSED, MEASURES, QUANTITIES
from app.services.export.values import is_of_kind
from app.store import EventRecord, MeasureRecord, ModelRecord, PersonRecord, PosteriorRecord
from study_core import session_codec
from study_core.comparison import Choice
from study_core.conduct import conduct_of
from study_core.events import AnswerGiven, AnswerTakenBack, Event, QueryPrepared, StepTaken
from study_core.path import questionnaire_of
from study_core.plan import position_of
from study_core.queries import Imported, Provenance
from study_core.session import SessionState, reduce
from study_core.study import Study

_MEASURE_KINDS = {column.name: column.kind for column in MEASURES}


def person_rows(study: Study, person: PersonRecord) -> Iterator[tuple[str, Row]]:
    """Gives every row of one person, posterior samples apart, with the name of its table."""
    ids = {"person_id": person.session.id, "study_hash": study.hash, "study_version": study.version}
    log = tuple(session_codec.from_json(event.kind, event.payload) for event in person.events)
    yield "people", ids | _person_row(study, person) | state_row(study, reduce(study, log))
    for table, row in chain(
        log_rows(study, person.events, log),
        (("measures", _measure_row(each)) for each in person.measures),
        (("posteriors", posterior_row(study, each)) for each in person.posteriors),
        (("networks", network_row(study.name, each)) for each in person.models),
        (("events", _event_row(each)) for each in person.events),
    ):
        yield table, ids | row


def log_rows(study: Study, events: Iterable[EventRecord], log: Sequence[Event]) -> Iterator[tuple[str, Row]]:
    """Gives the rows that are functions of a log: steps, responses, queries and answers; without ids."""
    withdrawn = _withdrawn(log)
    asked: dict[int, QueryPrepared] = {}
    for row, event in zip(events, log, strict=True):
        stands = {"is_taken_back": row.position in withdrawn}
        if isinstance(event, StepTaken):
            yield "steps", _step_row(study, row, event)
            yield from (("responses", each) for each in _response_rows(study, row, event))
        elif isinstance(event, QueryPrepared):
            asked[event.query_index] = event
            yield "queries", _query_row(study, row, event) | stands
        elif isinstance(event, AnswerGiven):
            yield "answers", _answer_row(row, event, asked[event.query_index]) | stands


def _withdrawn(log: Sequence[Event]) -> set[int]:
    """Returns the positions of answers that were taken back, and of the queries that had been prepared after them."""
    withdrawn: set[int] = set()
    for end, event in enumerate(log):
        if isinstance(event, AnswerTakenBack):
            before = reversed(range(end))
            answer = next(i for i in before if isinstance(log[i], AnswerGiven) and i not in withdrawn)
            queries = (i for i in range(answer, end) if isinstance(log[i], QueryPrepared))
            withdrawn |= {answer, *queries}
    return withdrawn


def _person_row(study: Study, person: PersonRecord) -> Row:
    external = person.external
    return {
        "study": study.name,
        "condition": study.condition,
        "ordinal": person.session.ordinal,
        "source": person.session.source.value,
        "created_at": person.session.created_at,
        "verdict": person.review.verdict,
        "verdict_reason": person.review.reason or None,
        "external_id": None if external is None else external.external_id,
        "other_ids": {} if external is None else external.other_ids,
    }


def state_row(study: Study, state: SessionState) -> Row:
    """Returns what a person's row says of their log."""
    conduct = conduct_of(state)
    return {
        "language": state.language or study.languages[0],
        "n_answers": len(state.answers),
        "is_finished": len(state.answers) == study.n_queries,
        "ending": state.ending,
        "n_repeats": conduct.n_repeats,
        "n_repeats_agreed": conduct.n_repeats_agreed,
        "n_checks": conduct.n_checks,
        "n_checks_passed": conduct.n_checks_passed,
        "n_sided": conduct.n_sided,
        "n_first": conduct.n_first,
        "median_response_ms": conduct.median_response_ms,
    }


def _step_row(study: Study, row: EventRecord, event: StepTaken) -> Row:
    read = event.content.get("read", {})
    return {
        "position": row.position,
        "step": event.step,
        "kind": study.file.path[event.step].step,
        "outcome": event.outcome,
        "language": read.get("language"),
        "text_sha256": read.get("text_sha256"),
        "at": row.at,
    }


def _response_rows(study: Study, row: EventRecord, event: StepTaken) -> Iterator[Row]:
    answers, questionnaire = event.content.get("answers"), questionnaire_of(study.file.path[event.step])
    if answers is None or questionnaire is None:
        return
    for item in study.file.questionnaire[questionnaire]:
        yield {
            "position": row.position,
            "step": event.step,
            "questionnaire": questionnaire,
            "item": item.name,
            "value": answers[item.name],
        }


def _query_row(study: Study, row: EventRecord, event: QueryPrepared) -> Row:
    query, provenance = event.proposed.query, event.proposed.provenance
    features = study.domain.feature_names
    return {
        "query_index": event.query_index,
        "position": row.position,
        "phase": event.phase,
        "prepared_at": row.at,
        "first_shown": event.first_shown,
        "repeat_of": event.repeat_of,
        "instructed": event.instructed,
        **_numbered("controls_a", query.controls_a.tolist()),
        **_numbered("controls_b", query.controls_b.tolist()),
        **_named("features_a", features, query.features_a.tolist()),
        **_named("features_b", features, query.features_b.tolist()),
        **(_imported(provenance) if isinstance(provenance, Imported) else _provenance(study, provenance)),
        "clips": event.clips,
        "code_version": event.code_version,
        "machine": event.machine,
        "compute_ms": event.compute_ms,
    }


def _imported(provenance: Imported) -> Row:
    return {
        "method": provenance.method,
        "imported_file": provenance.file,
        "imported_sha256": provenance.sha256,
        "imported_entry": provenance.entry,
    }


def _provenance(study: Study, provenance: Provenance) -> Row:
    weights = {"weights_a": provenance.weights_a, "weights_b": provenance.weights_b}
    row: Row = {
        "method": provenance.method,
        "score": provenance.score,
        "runner_up_score": provenance.runner_up_score,
        "pairs_tried": provenance.pairs_tried,
        "has_converged_a": provenance.has_converged[0],
        "has_converged_b": provenance.has_converged[1],
        "are_distinct": provenance.are_distinct,
        "visible_difference": provenance.visible_difference,
        "seed": provenance.seed,
        "stream": list(provenance.stream),
        "versions": list(provenance.versions),
        "bank_digest": provenance.bank_digest,
    }
    for prefix, values in weights.items():
        row |= {} if values is None else _named(prefix, study.weight_names, values.tolist())
    return row


def _answer_row(row: EventRecord, event: AnswerGiven, asked: QueryPrepared) -> Row:
    first_shown: Choice | None = asked.first_shown
    return {
        "query_index": event.query_index,
        "position": row.position,
        "phase": asked.phase,
        "choice": event.choice,
        "position_chosen": position_of(first_shown, event.choice),
        "response_time_ms": event.response_time_ms,
        "confidence": event.confidence,
        "answered_at": row.at,
    }


def _measure_row(measured: MeasureRecord) -> Row:
    # Nobody vouches for what a browser sends; a value of another form must not change the table's.
    known = {
        name: value
        for name, value in measured.measures.items()
        if name in _MEASURE_KINDS and is_of_kind(_MEASURE_KINDS[name], value)
    }
    other = {name: value for name, value in measured.measures.items() if name not in known}
    return {"query_index": measured.query_index, "received_at": measured.at, **known, "other": other}


def posterior_row(study: Study, posterior: PosteriorRecord) -> Row:
    """Returns the row of a posterior, without ids."""
    summary, n_weights = posterior.summary, len(posterior.mean)
    row: Row = {"query_index": posterior.query_index, "n_samples": len(posterior.samples)}
    row |= {key: summary[key] for key in ("has_converged", "acceptance", "n_draws", "warning")}
    row |= _named("mean", study.weight_names, posterior.mean.tolist())
    for key in DIAGNOSED:
        row |= _named(key, study.weight_names, summary[key][:n_weights])
        row |= _named(key, study.response.inferred, summary[key][n_weights:])
    for quantity in QUANTITIES:
        row |= {f"{quantity}_{quantile}": value for quantile, value in summary[quantity].items()}
    return row


def network_row(study_name: str, model: ModelRecord) -> Row:
    """Returns the row of a model; one that several people taught has no person."""
    return {
        "study": study_name,
        "kind": model.kind,
        "key": model.key,
        "sha256": hashlib.sha256(model.content).hexdigest(),
        "n_bytes": len(model.content),
        "lineage": model.lineage,
    }


def _event_row(event: EventRecord) -> Row:
    return {"position": event.position, "kind": event.kind, "at": event.at, "payload": event.payload}


def _numbered(prefix: str, values: Sequence[Any]) -> Row:
    return {f"{prefix}_{i}": value for i, value in enumerate(values)}


def _named(prefix: str, names: Sequence[str], values: Sequence[Any]) -> Row:
    """Returns a value for each name; a posterior has fewer than there are names before a feature is learned."""
    return {f"{prefix}_{name}": value for name, value in zip(names, values, strict=False)}
