"""Where every session stands, and who they are: what a monitor shows, without reading a log."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.store import reviews
from app.store.codec import decode_floats, decode_json, encode_floats
from app.store.desk_records import Arm, PersonLine
from app.store.models import ExternalPersonRow, ReviewRow, SessionRow, StandingRow, StudyRow
from app.store.records import ExternalPerson, Source, Standing
from app.store.sessions import COMPLETED, record_of
from app.store.utc import now

_FROM_THE_LOG = (
    *("step", "n_answers", "test_answers", "n_repeats", "n_repeats_agreed", "n_checks", "n_checks_passed"),
    *("n_sided", "n_first", "response_ms"),
)
_SHOWN = (*_FROM_THE_LOG, "n_events", "last_at", "n_waits", "waited_ms", "focus_losses", "r_hat", "ess")


def put(rows: Session, session_id: str, n_events: int, standing: Standing) -> None:
    """Keeps where a session stands now that its log has that length."""
    at = now()
    row = rows.get(StandingRow, session_id)
    if row is None:
        row = StandingRow(session_id=session_id, n_waits=0, waited_ms=0, focus_losses=0)
        rows.add(row)
    elif standing.is_wait:
        row.n_waits += 1
        row.waited_ms += (at - row.last_at) // timedelta(milliseconds=1)
    row.n_events, row.last_at = n_events, at
    row.focus_losses += standing.focus_losses
    for name in _FROM_THE_LOG:
        setattr(row, name, getattr(standing, name))
    if standing.mean is not None:
        row.r_hat, row.ess, row.mean = standing.r_hat, standing.ess, encode_floats(standing.mean)


def lengths(rows: Session) -> dict[str, int]:
    """By session, the length of the log that its standing was written with."""
    query = select(StandingRow.session_id, StandingRow.n_events)
    return {row.session_id: row.n_events for row in rows.execute(query)}


def lines(rows: Session, study_name: str, session_id: str | None = None) -> list[PersonLine]:
    """Everybody in a study of that name, or one of them, oldest first."""
    query = (
        select(SessionRow, StudyRow.version, StudyRow.condition, StandingRow, ReviewRow, ExternalPersonRow)
        .join(StudyRow, StudyRow.study_hash == SessionRow.study_hash)
        .outerjoin(StandingRow, StandingRow.session_id == SessionRow.id)
        .outerjoin(ReviewRow, ReviewRow.session_id == SessionRow.id)
        .outerjoin(ExternalPersonRow, ExternalPersonRow.session_id == SessionRow.id)
        .where(StudyRow.name == study_name)
        .order_by(SessionRow.created_at, SessionRow.ordinal)
    )
    if session_id is not None:
        query = query.where(SessionRow.id == session_id)
    return [_line(*row) for row in rows.execute(query)]


def arms(rows: Session, study_name: str, heard_since: datetime) -> list[Arm]:
    """How many have completed each condition of a study, in all its versions, and how many are under way.

    Whoever was rejected or excluded counts no more, nor does who hasn't ended and of whom nothing was heard since then.
    """
    has_completed = SessionRow.ending == COMPLETED
    last_heard = func.coalesce(StandingRow.last_at, SessionRow.created_at)
    is_under_way = SessionRow.ending.is_(None) & (last_heard >= heard_since)
    query = (
        select(
            StudyRow.condition,
            func.count().filter(has_completed),
            func.count().filter(is_under_way),
        )
        .join(SessionRow, SessionRow.study_hash == StudyRow.study_hash)
        .outerjoin(StandingRow, StandingRow.session_id == SessionRow.id)
        .outerjoin(ReviewRow, ReviewRow.session_id == SessionRow.id)
        .where(
            StudyRow.name == study_name,
            SessionRow.source == Source.JOINED.value,
            ReviewRow.verdict.is_(None),
        )
        .group_by(StudyRow.condition)
    )
    return [Arm(*row) for row in rows.execute(query)]


def _line(
    session: SessionRow,
    version: str,
    condition: str | None,
    standing: StandingRow | None,
    review: ReviewRow | None,
    external: ExternalPersonRow | None,
) -> PersonLine:
    person = (
        None
        if external is None
        else ExternalPerson(external.study_name, external.external_id, decode_json(external.other_ids))
    )
    return PersonLine(
        session=record_of(session),
        condition=condition,
        version=version,
        ending=session.ending,
        external=person,
        review=reviews.record_of(review),
        **({} if standing is None else _shown(standing)),
    )


def _shown(standing: StandingRow) -> dict[str, Any]:
    mean = None if standing.mean is None else decode_floats(standing.mean, (len(standing.mean) // 8,))
    return {name: getattr(standing, name) for name in _SHOWN} | {"mean": mean}
