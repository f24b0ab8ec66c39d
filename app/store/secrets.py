"""Secrets of the server's own."""

from __future__ import annotations

from secrets import token_bytes

from sqlalchemy.orm import Session

from app.store.models import SecretRow
from app.store.utc import now


def get(rows: Session, name: str) -> bytes:
    """The secret of that name: 256 random bits, made when it is first asked for."""
    row = rows.get(SecretRow, name)
    if row is None:
        row = SecretRow(name=name, value=token_bytes(32), created_at=now())
        rows.add(row)
    return row.value
