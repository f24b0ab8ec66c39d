"""What browsers measured."""

from __future__ import annotations

from sqlalchemy import insert, select
from sqlalchemy.orm import Session

from app.store import sessions
from app.store.codec import decode_json, encode_json
from app.store.models import BrowserMeasureRow, table_of
from app.store.records import MeasureRecord, NewReport
from app.store.utc import now


def add(rows: Session, session_id: str, report: NewReport) -> None:
    """Adds one report of a browser; a query may have several."""
    values = {
        "session_id": session_id,
        "query_index": report.query_index,
        "measures": encode_json(report.measures),
        "at": now(),
    }
    rows.execute(insert(table_of(BrowserMeasureRow)), [values])


def of_session(rows: Session, session_id: str) -> tuple[MeasureRecord, ...]:
    """A session's reports in the order they came."""
    sessions.by_id(rows, session_id)
    query = (
        select(BrowserMeasureRow)
        .where(BrowserMeasureRow.session_id == session_id)
        .order_by(BrowserMeasureRow.id)
    )
    return tuple(
        MeasureRecord(query_index=row.query_index, measures=decode_json(row.measures), at=row.at)
        for row in rows.scalars(query)
    )
