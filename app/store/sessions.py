"""Sessions: who walks which study, under which number."""

from __future__ import annotations

from uuid import uuid4

from sqlalchemy import Select, func, select, update
from sqlalchemy.orm import Session

from app.store import studies
from app.store.errors import SessionDeletedError, StoreError, UnknownError
from app.store.models import SessionRow, StudyRow, TombstoneRow, table_of
from app.store.records import SessionRecord, Source
from app.store.utc import now

COMPLETED = "completed"
_OLDEST_FIRST = (SessionRow.created_at, SessionRow.study_hash, SessionRow.ordinal)


def create(rows: Session, study_hash: str, source: Source, import_digest: str | None = None) -> SessionRecord:
    """Adds a session under the next number of the study, which goes through all its versions and conditions."""
    newest = rows.scalar(
        select(func.max(SessionRow.ordinal)).where(
            SessionRow.study_hash.in_(_versions_of(studies.name(rows, study_hash)))
        )
    )
    row = SessionRow(
        id=uuid4().hex,
        study_hash=study_hash,
        ordinal=(newest or 0) + 1,
        source=source.value,
        import_digest=import_digest,
        created_at=now(),
    )
    rows.add(row)
    rows.flush()
    return record_of(row)


def by_id(rows: Session, session_id: str) -> SessionRecord:
    """The session of this id."""
    row = rows.get(SessionRow, session_id)
    if row is None:
        raise unknown(rows, session_id)
    return record_of(row)


def by_import(rows: Session, import_digest: str) -> SessionRecord | None:
    """The session that was imported from files of that digest, if any."""
    row = rows.scalar(select(SessionRow).where(SessionRow.import_digest == import_digest))
    return None if row is None else record_of(row)


def unknown(rows: Session, session_id: str) -> StoreError:
    """What to raise when a session doesn't exist, or does no more."""
    tombstone = rows.get(TombstoneRow, session_id)
    if tombstone is not None:
        at = tombstone.deleted_at.isoformat(timespec="seconds")
        return SessionDeletedError(
            f"Session '{session_id}' was deleted at {at}. Nothing is kept for it any more."
        )
    return UnknownError(f"Expected the id of a session, got '{session_id}'. `prefstudy export` lists them.")


def every(rows: Session, study_hash: str | None) -> list[SessionRecord]:
    """All sessions, or a study's, oldest first."""
    query = select(SessionRow).order_by(*_OLDEST_FIRST)
    if study_hash is not None:
        query = query.where(SessionRow.study_hash == study_hash)
    return [record_of(row) for row in rows.scalars(query)]


def of_study_named(rows: Session, name: str) -> list[SessionRecord]:
    """The sessions of every version of the study that has this name, oldest first."""
    query = select(SessionRow).where(SessionRow.study_hash.in_(_versions_of(name))).order_by(*_OLDEST_FIRST)
    return [record_of(row) for row in rows.scalars(query)]


def end(rows: Session, session_id: str, ending: str | None) -> None:
    """Says how a session has ended, or that it goes on."""
    changed = SessionRow.ending.is_distinct_from(ending)
    rows.execute(
        update(table_of(SessionRow)).where(SessionRow.id == session_id, changed).values(ending=ending)
    )


def ending(rows: Session, session_id: str) -> str | None:
    """How a session has ended, if it has."""
    by_id(rows, session_id)
    return rows.scalar(select(SessionRow.ending).where(SessionRow.id == session_id))


def _versions_of(name: str) -> Select[str]:
    return select(StudyRow.study_hash).where(StudyRow.name == name)


def record_of(row: SessionRow) -> SessionRecord:
    """What goes out of the store of a session's row."""
    return SessionRecord(
        id=row.id,
        study_hash=row.study_hash,
        ordinal=row.ordinal,
        source=Source(row.source),
        created_at=row.created_at,
    )
