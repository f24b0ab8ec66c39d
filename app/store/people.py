"""Everything about one person, read at one moment."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy.orm import Session

from app.store import events, external, learned, measures, posteriors, reviews, sessions
from app.store.desk_records import Review
from app.store.records import (
    EventRecord,
    ExternalPerson,
    MeasureRecord,
    ModelRecord,
    PosteriorRecord,
    SessionRecord,
)


@dataclass(frozen=True, eq=False)
class PersonRecord:
    """All that is kept of one person, as it was at one moment.

    Attributes:
        session: The session.
        ending: How it has ended; None while it goes on.
        external: Who the person is to whoever sent them, if anybody did.
        review: What experimenters have decided about the session.
        events: The log, in order.
        measures: What browsers measured, in the order it came.
        posteriors: By query index.
        models: What was learned from the person alone.
    """

    session: SessionRecord
    ending: str | None
    external: ExternalPerson | None
    review: Review
    events: tuple[EventRecord, ...]
    measures: tuple[MeasureRecord, ...]
    posteriors: tuple[PosteriorRecord, ...]
    models: tuple[ModelRecord, ...]


def of_session(rows: Session, session_id: str) -> PersonRecord:
    """All that is kept under a session."""
    return PersonRecord(
        session=sessions.by_id(rows, session_id),
        ending=sessions.ending(rows, session_id),
        external=external.of_session(rows, session_id),
        review=reviews.of_session(rows, session_id),
        events=events.of_session(rows, session_id),
        measures=measures.of_session(rows, session_id),
        posteriors=posteriors.of_session(rows, session_id),
        models=learned.every_personal(rows, session_id),
    )
