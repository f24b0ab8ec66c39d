"""Everything about one person, read at one moment."""

from __future__ import annotations

from sqlalchemy.orm import Session

from app.store import events, external, learned, measures, posteriors, sessions
from app.store.records import PersonRecord


def of_session(rows: Session, session_id: str) -> PersonRecord:
    """All that is kept under a session."""
    return PersonRecord(
        session=sessions.by_id(rows, session_id),
        ending=sessions.ending(rows, session_id),
        external=external.of_session(rows, session_id),
        events=events.of_session(rows, session_id),
        measures=measures.of_session(rows, session_id),
        posteriors=posteriors.of_session(rows, session_id),
        models=learned.every_personal(rows, session_id),
    )
