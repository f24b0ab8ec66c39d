"""What is decided about people: by experimenters, or by their study file beforehand."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.store import sessions
from app.store.desk_records import Review, Verdict
from app.store.errors import ReviewChangedError
from app.store.models import ReviewRow, SessionRow, StudyRow
from app.store.utc import now

STUDY_FILE = "study file"
"""Who decides what was decided beforehand."""


def of_session(rows: Session, session_id: str) -> Review:
    """What is decided about a session."""
    sessions.by_id(rows, session_id)
    return record_of(rows.get(ReviewRow, session_id))


def against(rows: Session, study_name: str) -> dict[str, Review]:
    """By session, what speaks against people of a study; nobody else is in it."""
    query = (
        select(ReviewRow)
        .join(SessionRow, SessionRow.id == ReviewRow.session_id)
        .join(StudyRow, StudyRow.study_hash == SessionRow.study_hash)
        .where(StudyRow.name == study_name, ReviewRow.verdict.is_not(None))
    )
    return {row.session_id: record_of(row) for row in rows.scalars(query)}


def put(rows: Session, session_id: str, review: Review, who: str) -> Review:
    """Changes what is decided about a session, if nobody has since whoever changes it looked."""
    known = of_session(rows, session_id)
    if known.revision != review.revision:
        raise ReviewChangedError(
            f"{known.changed_by} has changed this person's record since you opened it. "
            "Look at what it says now, then make your change again."
        )
    verdict = None if review.verdict is None else review.verdict.value
    row = ReviewRow(
        session_id=session_id,
        verdict=verdict,
        reason=review.reason,
        note=review.note,
        revision=known.revision + 1,
        changed_by=who,
        changed_at=now(),
    )
    return record_of(rows.merge(row))


def exclude(rows: Session, session_id: str, reason: str) -> None:
    """Excludes somebody by what their study file says, unless something is decided about them already."""
    known = of_session(rows, session_id)
    if known.verdict is None:
        put(rows, session_id, Review(Verdict.EXCLUDED, reason, known.note, known.revision), STUDY_FILE)


def record_of(row: ReviewRow | None) -> Review:
    """What experimenters have decided; nothing without a row."""
    if row is None:
        return Review()
    verdict = None if row.verdict is None else Verdict(row.verdict)
    return Review(verdict, row.reason, row.note, row.revision, row.changed_by, row.changed_at)
