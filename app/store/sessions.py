"""Sessions: who walks which study, under which number."""

from __future__ import annotations

from uuid import uuid4

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.store import studies
from app.store.errors import StoreError
from app.store.models import SessionRow
from app.store.records import SessionRecord
from app.store.utc import now


def create(rows: Session, study_hash: str, token_hash: str, is_rehearsed: bool) -> SessionRecord:
    """Adds a session under the study's next number."""
    studies.text(rows, study_hash)
    if by_token(rows, token_hash) is not None:
        raise StoreError("Expected a fresh token, got one that a session already has. Draw another.")
    newest = rows.scalar(select(func.max(SessionRow.ordinal)).where(SessionRow.study_hash == study_hash))
    row = SessionRow(
        id=uuid4().hex,
        study_hash=study_hash,
        ordinal=(newest or 0) + 1,
        token_hash=token_hash,
        is_rehearsed=is_rehearsed,
        created_at=now(),
    )
    rows.add(row)
    return _record(row)


def by_token(rows: Session, token_hash: str) -> SessionRecord | None:
    """The session that a token opens, if any."""
    row = rows.scalar(select(SessionRow).where(SessionRow.token_hash == token_hash))
    return None if row is None else _record(row)


def by_id(rows: Session, session_id: str) -> SessionRecord:
    """The session of this id."""
    row = rows.get(SessionRow, session_id)
    if row is None:
        raise unknown(session_id)
    return _record(row)


def unknown(session_id: str) -> StoreError:
    """What to raise when a session doesn't exist."""
    return StoreError(f"Expected the id of a session, got '{session_id}'. List them with Store.sessions().")


def every(rows: Session, study_hash: str | None) -> list[SessionRecord]:
    """All sessions, or a study's, oldest first."""
    query = select(SessionRow).order_by(SessionRow.created_at, SessionRow.study_hash, SessionRow.ordinal)
    if study_hash is not None:
        query = query.where(SessionRow.study_hash == study_hash)
    return [_record(row) for row in rows.scalars(query)]


def _record(row: SessionRow) -> SessionRecord:
    return SessionRecord(
        id=row.id,
        study_hash=row.study_hash,
        ordinal=row.ordinal,
        is_rehearsed=row.is_rehearsed,
        created_at=row.created_at,
    )
