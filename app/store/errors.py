"""What the store refuses, by name."""

from app.errors import AppError


class StoreError(AppError):
    """The database can't be used as asked; the message carries the remedy."""


class UnknownError(StoreError):
    """What is asked for isn't there: a session, a study, an experimenter or a token of that name."""


class LastOwnerError(StoreError):
    """Somebody must be left who may do everything; nothing was written."""


class SessionDeletedError(StoreError):
    """The session was deleted; what comes late for it, a query or a model, is not kept."""


class PositionTakenError(StoreError):
    """Somebody else wrote here first: the log's position, or the answer to the query, is taken.

    A double press, a second tab or a late retry ends here. Nothing was written; read the log again.
    """


class TokenTakenError(StoreError):
    """The token opens a session already; nothing was written."""


class PersonKnownError(StoreError):
    """The external id has a session already; nothing was written."""


class PopulationWithdrawnError(PositionTakenError):
    """Somebody whom the session's start was learned from has been deleted. Nothing was written; read the log again."""


class ExperimenterKnownError(StoreError):
    """There is an experimenter of that name, or an owner, already; nothing was written."""


class ReviewChangedError(StoreError):
    """Somebody else has changed what is decided about a person; nothing was written."""
