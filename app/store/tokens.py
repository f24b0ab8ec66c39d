"""The secrets that open sessions, by their hashes."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.store import sessions
from app.store.errors import TokenTakenError
from app.store.models import SessionTokenRow
from app.store.records import SessionRecord
from app.store.utc import now


def add(rows: Session, session_id: str, token_hash: str, code_hash: str | None) -> None:
    """Lets a token open a session; doing it twice changes nothing."""
    known = rows.get(SessionTokenRow, token_hash)
    if known is not None:
        if known.session_id != session_id:
            raise TokenTakenError("Expected a fresh token, got one that opens a session. Draw another.")
        return
    row = SessionTokenRow(token_hash=token_hash, session_id=session_id, code_hash=code_hash, created_at=now())
    rows.add(row)
    rows.flush()


def session(rows: Session, token_hash: str) -> SessionRecord | None:
    """The session that a token opens, if any."""
    row = rows.get(SessionTokenRow, token_hash)
    return None if row is None else sessions.by_id(rows, row.session_id)


def session_of_code(rows: Session, code_hash: str) -> SessionRecord | None:
    """The session that a code gets another token for, if any."""
    row = rows.scalar(select(SessionTokenRow).where(SessionTokenRow.code_hash == code_hash))
    return None if row is None else sessions.by_id(rows, row.session_id)
