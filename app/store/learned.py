"""Models that learned from people: of one person, or shared by the people of a study.

A model is kept as long as everyone it learned from is.
"""

from __future__ import annotations

from collections.abc import Iterable

from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session

from app.store import sessions
from app.store.codec import decode_json, encode_json
from app.store.errors import StoreError
from app.store.models import PersonalModelRow, SharedModelPersonRow, SharedModelRow, table_of
from app.store.records import ModelRecord
from app.store.utc import now


def put_personal(rows: Session, session_id: str, model: ModelRecord) -> None:
    """Keeps a person's model in the place of an earlier one of its kind."""
    sessions.by_id(rows, session_id)
    rows.merge(
        PersonalModelRow(
            session_id=session_id,
            kind=model.kind,
            key=model.key,
            content=model.content,
            lineage=encode_json(model.lineage),
            created_at=now(),
        )
    )


def personal(rows: Session, session_id: str, kind: str) -> ModelRecord | None:
    """A person's model of that kind, if there is one."""
    sessions.by_id(rows, session_id)
    row = rows.get(PersonalModelRow, (session_id, kind))
    return None if row is None else _record(row)


def every_personal(rows: Session, session_id: str) -> tuple[ModelRecord, ...]:
    """All models of a person, by kind."""
    query = (
        select(PersonalModelRow)
        .where(PersonalModelRow.session_id == session_id)
        .order_by(PersonalModelRow.kind)
    )
    return tuple(_record(row) for row in rows.scalars(query))


def personal_key(rows: Session, session_id: str, kind: str) -> str | None:
    """The key of a person's model of that kind, if there is one; the model itself isn't read."""
    query = select(PersonalModelRow.key).where(
        PersonalModelRow.session_id == session_id, PersonalModelRow.kind == kind
    )
    return rows.scalar(query)


def put_shared(rows: Session, study_name: str, model: ModelRecord, session_ids: Iterable[str]) -> None:
    """Keeps a study's model with everyone it learned from, in the place of an earlier one of its kind."""
    people = sorted(set(session_ids))
    if not people:
        raise StoreError("Expected the people a shared model learned from, got nobody. Name their sessions.")
    for session_id in people:
        sessions.by_id(rows, session_id)
    _drop_shared(rows, study_name, model.kind)
    row = SharedModelRow(
        study_name=study_name,
        kind=model.kind,
        key=model.key,
        content=model.content,
        lineage=encode_json(model.lineage),
        created_at=now(),
    )
    rows.add(row)
    rows.flush()
    learned_from = [
        {"study_name": study_name, "kind": model.kind, "session_id": session_id} for session_id in people
    ]
    rows.execute(insert(table_of(SharedModelPersonRow)), learned_from)


def shared(rows: Session, study_name: str, kind: str) -> ModelRecord | None:
    """A study's model of that kind, if there is one."""
    row = rows.get(SharedModelRow, (study_name, kind))
    return None if row is None else _record(row)


def every_shared(rows: Session, study_name: str) -> tuple[ModelRecord, ...]:
    """All models of a study, by kind."""
    query = (
        select(SharedModelRow).where(SharedModelRow.study_name == study_name).order_by(SharedModelRow.kind)
    )
    return tuple(_record(row) for row in rows.scalars(query))


def drop_shared_of(rows: Session, session_id: str) -> int:
    """Removes every shared model that learned from a person; returns how many."""
    query = select(SharedModelPersonRow).where(SharedModelPersonRow.session_id == session_id)
    models = [(row.study_name, row.kind) for row in rows.scalars(query)]
    for study_name, kind in models:
        _drop_shared(rows, study_name, kind)
    return len(models)


def _drop_shared(rows: Session, study_name: str, kind: str) -> None:
    rows.execute(
        delete(SharedModelRow).where(SharedModelRow.study_name == study_name, SharedModelRow.kind == kind),
        execution_options={"synchronize_session": False},
    )


def _record(row: PersonalModelRow | SharedModelRow) -> ModelRecord:
    return ModelRecord(kind=row.kind, key=row.key, content=row.content, lineage=decode_json(row.lineage))
