"""What the application keeps: studies, sessions and their logs, posteriors, models, computed results.

The only package that imports SQLAlchemy. Its rows stay inside; records go in and come out.
"""

from app.store.errors import (
    PersonKnownError,
    PopulationWithdrawnError,
    PositionTakenError,
    SessionDeletedError,
    StoreError,
    TokenTakenError,
)
from app.store.locking import serve_lock
from app.store.records import (
    Deletion,
    EventRecord,
    ExternalPerson,
    ImportedSession,
    MeasureRecord,
    ModelRecord,
    NewEvent,
    NewReport,
    PersonRecord,
    PosteriorRecord,
    SessionRecord,
    Source,
)
from app.store.store import Store, open_existing_store, open_store

__all__ = [
    "Deletion",
    "EventRecord",
    "ExternalPerson",
    "ImportedSession",
    "MeasureRecord",
    "ModelRecord",
    "NewEvent",
    "NewReport",
    "PersonKnownError",
    "PersonRecord",
    "PopulationWithdrawnError",
    "PositionTakenError",
    "PosteriorRecord",
    "SessionDeletedError",
    "SessionRecord",
    "Source",
    "Store",
    "StoreError",
    "TokenTakenError",
    "open_existing_store",
    "open_store",
    "serve_lock",
]
