"""Who people are to whoever sent them: one session an external id, and a new one when that has become too old."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import Select, delete, func, select
from sqlalchemy.orm import Session

from app.store import sessions
from app.store.codec import decode_json, encode_json
from app.store.errors import PersonKnownError
from app.store.models import ExternalPersonRow, SessionRow
from app.store.records import ExternalPerson, SessionRecord


def add(rows: Session, session_id: str, person: ExternalPerson, after: str | None) -> None:
    """Says whose a session is; `after` names their session before it."""
    newest = _newest(rows, person.study_name, person.external_id)
    if (None if newest is None else newest.session_id) != after:
        raise PersonKnownError(
            f"Expected an external id whose last session is {after}, got one that has another. Go on with that one."
        )
    row = ExternalPersonRow(
        study_name=person.study_name,
        external_id=person.external_id,
        attempt=0 if newest is None else newest.attempt + 1,
        session_id=session_id,
        other_ids=encode_json(person.other_ids),
    )
    rows.add(row)
    rows.flush()


def session(rows: Session, study_name: str, external_id: str) -> SessionRecord | None:
    """The newest session of an external id, if it has any."""
    newest = _newest(rows, study_name, external_id)
    return None if newest is None else sessions.by_id(rows, newest.session_id)


def of_session(rows: Session, session_id: str) -> ExternalPerson | None:
    """Who a session's person is to whoever sent them, if anybody did."""
    row = rows.scalar(select(ExternalPersonRow).where(ExternalPersonRow.session_id == session_id))
    return (
        None if row is None else ExternalPerson(row.study_name, row.external_id, decode_json(row.other_ids))
    )


def sessions_of_same_person(rows: Session, session_id: str) -> Sequence[str]:
    """The ids of all sessions of a session's person, itself among them, oldest first."""
    person = of_session(rows, session_id)
    if person is None:
        return [session_id]
    query = _sessions_of(person.study_name, person.external_id).order_by(ExternalPersonRow.attempt)
    return [row.session_id for row in rows.scalars(query)]


def forget_of_ended(rows: Session, study_name: str, begun_before: datetime) -> int:
    """Forgets who the people of a study were to whoever sent them, where the session has ended; returns of how many."""
    ended = select(SessionRow.id).where(SessionRow.ending.is_not(None), SessionRow.created_at < begun_before)
    of_them = (ExternalPersonRow.study_name == study_name) & ExternalPersonRow.session_id.in_(ended)
    n_people = rows.scalar(select(func.count()).where(of_them)) or 0
    rows.execute(delete(ExternalPersonRow).where(of_them))
    return n_people


def _newest(rows: Session, study_name: str, external_id: str) -> ExternalPersonRow | None:
    query = _sessions_of(study_name, external_id).order_by(ExternalPersonRow.attempt.desc()).limit(1)
    return rows.scalar(query)


def _sessions_of(study_name: str, external_id: str) -> Select[ExternalPersonRow]:
    return select(ExternalPersonRow).where(
        ExternalPersonRow.study_name == study_name, ExternalPersonRow.external_id == external_id
    )
