"""What the application keeps: studies, sessions and their logs, posteriors, models, computed results.

The only package that imports SQLAlchemy. Its rows stay inside; records go in and come out.
"""

from app.store.errors import PopulationWithdrawnError, PositionTakenError, SessionDeletedError, StoreError
from app.store.locking import serve_lock
from app.store.records import (
    Deletion,
    EventRecord,
    ImportedSession,
    MeasureRecord,
    ModelRecord,
    NewEvent,
    NewReport,
    PosteriorRecord,
    SessionRecord,
    Source,
)
from app.store.store import Store, open_existing_store, open_store

__all__ = [
    "Deletion",
    "EventRecord",
    "ImportedSession",
    "MeasureRecord",
    "ModelRecord",
    "NewEvent",
    "NewReport",
    "PopulationWithdrawnError",
    "PositionTakenError",
    "PosteriorRecord",
    "SessionDeletedError",
    "SessionRecord",
    "Source",
    "Store",
    "StoreError",
    "open_existing_store",
    "open_store",
    "serve_lock",
]
