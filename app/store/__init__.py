"""What the application keeps: studies, sessions and their logs, posteriors, models, computed results.

The only package that imports SQLAlchemy. Its rows stay inside; records go in and come out.
"""

from app.store.desk import DeskStore
from app.store.desk_records import (
    ApiToken,
    Arm,
    AuditEntry,
    Experimenter,
    PersonLine,
    Review,
    Role,
    Verdict,
)
from app.store.errors import (
    ExperimenterKnownError,
    LastOwnerError,
    PersonKnownError,
    PopulationWithdrawnError,
    PositionTakenError,
    ReviewChangedError,
    SessionDeletedError,
    StoreError,
    TokenTakenError,
    UnknownError,
)
from app.store.locking import serve_lock
from app.store.people import PersonRecord
from app.store.records import (
    Deletion,
    EventRecord,
    ExternalPerson,
    ImportedSession,
    MeasureRecord,
    ModelRecord,
    NewEvent,
    NewReport,
    PosteriorRecord,
    SessionRecord,
    Source,
    Standing,
    StudyRecord,
)
from app.store.store import Store, open_existing_store, open_store

__all__ = [
    "ApiToken",
    "Arm",
    "AuditEntry",
    "Deletion",
    "DeskStore",
    "EventRecord",
    "Experimenter",
    "ExperimenterKnownError",
    "ExternalPerson",
    "ImportedSession",
    "LastOwnerError",
    "MeasureRecord",
    "ModelRecord",
    "NewEvent",
    "NewReport",
    "PersonKnownError",
    "PersonLine",
    "PersonRecord",
    "PopulationWithdrawnError",
    "PositionTakenError",
    "PosteriorRecord",
    "Review",
    "ReviewChangedError",
    "Role",
    "SessionDeletedError",
    "SessionRecord",
    "Source",
    "Standing",
    "Store",
    "StoreError",
    "StudyRecord",
    "TokenTakenError",
    "UnknownError",
    "Verdict",
    "open_existing_store",
    "open_store",
    "serve_lock",
]
