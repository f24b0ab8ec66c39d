"""A session's log: append-only, one writer per position."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import bindparam, func, insert, or_, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from app.store import posteriors, sessions
from app.store.codec import decode_json, encode_json
from app.store.errors import PopulationWithdrawnError, PositionTakenError, StoreError
from app.store.models import EventRow, SessionRow, TombstoneRow, table_of
from app.store.records import EventRecord, NewEvent, PosteriorRecord
from app.store.utc import now

_ANSWER = "answer_given"
_PREPARED = "query_prepared"
_ADOPTED = "population_adopted"

_LAST_POSITION = (
    select(
        select(func.max(EventRow.position))
        .where(EventRow.session_id == bindparam("session_id"))
        .scalar_subquery()
        .label("position")
    )
    .select_from(SessionRow)
    .where(SessionRow.id == bindparam("session_id"))
)


def of_session(rows: Session, session_id: str) -> tuple[EventRecord, ...]:
    """The whole log in order."""
    sessions.by_id(rows, session_id)
    query = select(EventRow).where(EventRow.session_id == session_id).order_by(EventRow.position)
    return tuple(_record(row) for row in rows.scalars(query))


def active_of_session(rows: Session, session_id: str, n_active: int) -> tuple[EventRecord, ...]:
    """The log without the queries from number `n_active` on, and without their answers."""
    sessions.by_id(rows, session_id)
    of_query = func.coalesce(EventRow.prepared_query, EventRow.answered_query)
    query = (
        select(EventRow)
        .where(EventRow.session_id == session_id, or_(of_query.is_(None), of_query < n_active))
        .order_by(EventRow.position)
    )
    return tuple(_record(row) for row in rows.scalars(query))


def n_answers(rows: Session, session_id: str) -> int:
    """How many answers a session has; what they say isn't read."""
    sessions.by_id(rows, session_id)
    query = select(func.count(EventRow.answered_query)).where(EventRow.session_id == session_id)
    return rows.scalar(query) or 0


def append(
    rows: Session,
    session_id: str,
    expected_position: int,
    events: Sequence[NewEvent],
    posterior: PosteriorRecord | None,
    goes_on_from_people: bool = False,
) -> None:
    """Adds events at the end of the log, with the posterior that belongs to them."""
    if goes_on_from_people:
        _refuse_if_withdrawn(rows, session_id)
    for event in events:
        if event.kind == _ADOPTED:
            _refuse_if_deleted(rows, session_id, event.payload["learned_from"])
    length = _length(rows, session_id)
    if length != expected_position:
        raise PositionTakenError(
            f"Expected the log of session {session_id} to have {expected_position} events, "
            f"it has {length}. Read the log again."
        )
    at = now()
    values = [
        _values(session_id, expected_position + offset, event, at) for offset, event in enumerate(events)
    ]
    try:
        rows.execute(insert(table_of(EventRow)), values)
    except IntegrityError as error:
        raise PositionTakenError(
            f"Expected new events for session {session_id}, got one already in the log: {error.orig}. "
            "A query is prepared once and answered once; read the log again."
        ) from error
    if posterior is not None:
        posteriors.add(rows, session_id, posterior)


def withdraw_populations(rows: Session, session_id: str) -> None:
    """Takes out of all logs what was learned from a person, and the posteriors that are nothing but draws from it.

    That somebody started from the people before, and from whom, stays. It is the one case in which an entry of a log
    that stays is changed.
    """
    query = select(EventRow).where(EventRow.kind == _ADOPTED, EventRow.payload.contains(session_id))
    for row in rows.scalars(query):
        payload = decode_json(row.payload)
        if payload["population"] is None:
            continue
        row.payload = encode_json({**payload, "population": None})
        posteriors.drop_first(rows, row.session_id)
    rows.flush()


def _refuse_if_withdrawn(rows: Session, session_id: str) -> None:
    query = select(EventRow.payload).where(EventRow.session_id == session_id, EventRow.kind == _ADOPTED)
    for payload in rows.scalars(query):
        if decode_json(payload)["population"] is None:
            raise _withdrawn(session_id)


def _refuse_if_deleted(rows: Session, session_id: str, learned_from: Sequence[str]) -> None:
    query = select(TombstoneRow).where(TombstoneRow.session_id.in_(learned_from))
    if rows.scalars(query).first() is not None:
        raise _withdrawn(session_id)


def _withdrawn(session_id: str) -> PopulationWithdrawnError:
    return PopulationWithdrawnError(
        f"Somebody whom the start of session {session_id} was learned from has been deleted. Read the log again."
    )


def _length(rows: Session, session_id: str) -> int:
    """Length of a session's log.

    Raises:
        StoreError: When there is no such session.
    """
    last = rows.execute(_LAST_POSITION, {"session_id": session_id}).one_or_none()
    if last is None:
        raise sessions.unknown(rows, session_id)
    return 0 if last.position is None else int(last.position) + 1


def _values(session_id: str, position: int, event: NewEvent, at: datetime) -> dict[str, Any]:
    return {
        "session_id": session_id,
        "position": position,
        "kind": event.kind,
        "payload": encode_json(event.payload),
        "at": at,
        "answered_query": _query_index(event.payload) if event.kind == _ANSWER else None,
        "prepared_query": _query_index(event.payload) if event.kind == _PREPARED else None,
    }


def _query_index(payload: dict[str, Any]) -> int:
    value = payload.get("query_index")
    if type(value) is not int:
        raise StoreError(
            f"Expected an integer 'query_index' in the payload of '{_ANSWER}' and '{_PREPARED}', "
            f"got {value!r}. Put the query's own number there."
        )
    return value


def _record(row: EventRow) -> EventRecord:
    return EventRecord(position=row.position, kind=row.kind, payload=decode_json(row.payload), at=row.at)
