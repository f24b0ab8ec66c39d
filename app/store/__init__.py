"""What the application keeps: studies, sessions and their logs, posteriors, computed results.

The only package that imports SQLAlchemy. Its rows stay inside; records go in and come out.
"""

from app.store.errors import PositionTakenError, StoreError
from app.store.locking import serve_lock
from app.store.records import EventRecord, MeasureRecord, NewEvent, NewReport, PosteriorRecord, SessionRecord
from app.store.store import Store, open_store

__all__ = [
    "EventRecord",
    "MeasureRecord",
    "NewEvent",
    "NewReport",
    "PositionTakenError",
    "PosteriorRecord",
    "SessionRecord",
    "Store",
    "StoreError",
    "open_store",
    "serve_lock",
]
