"""Results named by the hash of what they were computed from."""

from __future__ import annotations

from sqlalchemy.orm import Session

from app.store.models import ArtifactRow
from app.store.utc import now


def put(rows: Session, key: str, kind: str, content: bytes) -> None:
    """Keeps a result; the first one kept under a key stays."""
    if rows.get(ArtifactRow, key) is None:
        rows.add(ArtifactRow(key=key, kind=kind, content=content, created_at=now()))


def content(rows: Session, key: str) -> bytes | None:
    """The result kept under a key, if any."""
    row = rows.get(ArtifactRow, key)
    return None if row is None else row.content
