"""Study definitions: the text of each, kept for ever."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.store.errors import StoreError, UnknownError
from app.store.models import StudyRow
from app.store.records import StudyRecord
from app.store.utc import now


def put(rows: Session, study_hash: str, name: str, text: str, version: str, condition: str | None) -> None:
    """Keeps a study's text; keeping it again changes nothing."""
    known = rows.get(StudyRow, study_hash)
    if known is None:
        row = StudyRow(
            study_hash=study_hash,
            name=name,
            text=text,
            version=version,
            condition=condition,
            created_at=now(),
        )
        rows.add(row)
    elif known.text != text:
        raise StoreError(
            f"Expected the text kept under the study hash {study_hash}, got a different one. "
            "Hash the whole text."
        )


def text(rows: Session, study_hash: str) -> str:
    """The text kept under a hash."""
    return _known(rows, study_hash).text


def name(rows: Session, study_hash: str) -> str:
    """The name of the study kept under a hash."""
    return _known(rows, study_hash).name


def every(rows: Session) -> list[StudyRecord]:
    """Every text that was kept, newest first."""
    query = select(StudyRow).order_by(StudyRow.created_at.desc(), StudyRow.condition)
    return [
        StudyRecord(row.study_hash, row.name, row.version, row.condition, row.created_at)
        for row in rows.scalars(query)
    ]


def _known(rows: Session, study_hash: str) -> StudyRow:
    known = rows.get(StudyRow, study_hash)
    if known is None:
        raise UnknownError(f"Expected a known study, got the hash {study_hash}. Put the study first.")
    return known
