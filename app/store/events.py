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
_TAKEN_BACK = "answer_taken_back"
_ADOPTED = "population_adopted"

_LAST = (
    select(EventRow.position, EventRow.revision, EventRow.taken_back_query)
    .select_from(SessionRow)
    .outerjoin(EventRow, EventRow.session_id == SessionRow.id)
    .where(SessionRow.id == bindparam("session_id"))
    .order_by(EventRow.position.desc())
    .limit(1)
)


def of_session(rows: Session, session_id: str) -> tuple[EventRecord, ...]:
    """The whole log in order."""
    sessions.by_id(rows, session_id)
    query = select(EventRow).where(EventRow.session_id == session_id).order_by(EventRow.position)
    return tuple(_record(row) for row in rows.scalars(query))


def active_of_session(rows: Session, session_id: str, n_active: int) -> tuple[EventRecord, ...]:
    """The log without the queries from number `n_active` on, and without their answers, also those taken back."""
    sessions.by_id(rows, session_id)
    of_query = func.coalesce(EventRow.prepared_query, EventRow.answered_query, EventRow.taken_back_query)
    query = (
        select(EventRow)
        .where(EventRow.session_id == session_id, or_(of_query.is_(None), of_query < n_active))
        .order_by(EventRow.position)
    )
    return tuple(_record(row) for row in rows.scalars(query))


def n_answers(rows: Session, session_id: str) -> int:
    """How many answers of a session stand; what they say isn't read."""
    sessions.by_id(rows, session_id)
    n_standing = func.count(EventRow.answered_query) - func.count(EventRow.taken_back_query)
    return rows.scalar(select(n_standing).where(EventRow.session_id == session_id)) or 0


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
    length, revision = _end(rows, session_id)
    if length != expected_position:
        raise PositionTakenError(
            f"Expected the log of session {session_id} to have {expected_position} events, "
            f"it has {length}. Read the log again."
        )
    at = now()
    values = []
    for position, event in enumerate(events, start=expected_position):
        values.append(_values(session_id, position, revision, event, at))
        revision += event.kind == _TAKEN_BACK
    try:
        rows.execute(insert(table_of(EventRow)), values)
    except IntegrityError as error:
        raise PositionTakenError(
            f"Expected new events for session {session_id}, got one already in the log: {error.orig}. "
            "A query is prepared once and answered once, until its answer is taken back; read the log again."
        ) from error
    for event in events:
        if event.kind == _TAKEN_BACK:
            posteriors.drop_after(rows, session_id, _query_index(event.payload))
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
        posteriors.drop(rows, row.session_id, 0)
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


def _end(rows: Session, session_id: str) -> tuple[int, int]:
    """Length of a session's log, and how many answers have been taken back in it.

    Raises:
        StoreError: When there is no such session.
    """
    last = rows.execute(_LAST, {"session_id": session_id}).one_or_none()
    if last is None:
        raise sessions.unknown(rows, session_id)
    if last.position is None:
        return 0, 0
    return last.position + 1, last.revision + (last.taken_back_query is not None)


def _values(session_id: str, position: int, revision: int, event: NewEvent, at: datetime) -> dict[str, Any]:
    return {
        "session_id": session_id,
        "position": position,
        "kind": event.kind,
        "payload": encode_json(event.payload),
        "at": at,
        "answered_query": _query_index(event.payload) if event.kind == _ANSWER else None,
        "prepared_query": _query_index(event.payload) if event.kind == _PREPARED else None,
        "taken_back_query": _query_index(event.payload) if event.kind == _TAKEN_BACK else None,
        "revision": revision,
    }


def _query_index(payload: dict[str, Any]) -> int:
    value = payload.get("query_index")
    if type(value) is not int:
        raise StoreError(
            f"Expected an integer 'query_index' in the payload of '{_ANSWER}', '{_PREPARED}' and '{_TAKEN_BACK}', "
            f"got {value!r}. Put the query's own number there."
        )
    return value


def _record(row: EventRow) -> EventRecord:
    return EventRecord(position=row.position, kind=row.kind, payload=decode_json(row.payload), at=row.at)
