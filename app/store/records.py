"""What goes into the store and comes out of it: frozen plain data, never an ORM row."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SessionRecord:
    """One person's run through a study.

    Attributes:
        id: Random name of the session, a uuid4 in 32 hexadecimal digits.
        study_hash: Names the study text the session was created under.
        ordinal: The session's number within its study, from 1; seeds the session's random streams.
        is_rehearsed: Whether a simulated or scripted person walks it.
        created_at: When it was created, aware, UTC.
    """

    id: str
    study_hash: str
    ordinal: int
    is_rehearsed: bool
    created_at: datetime


@dataclass(frozen=True)
class NewEvent:
    """Something that has happened and is to be put in the log.

    Attributes:
        kind: Past tense, such as `answer_given`.
        payload: JSON; `answer_given` and `query_prepared` carry an integer `query_index`.
    """

    kind: str
    payload: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class EventRecord:
    """One entry of a session's log.

    Attributes:
        position: Place in the log, from 0 without gaps.
        kind: Past tense, such as `answer_given`.
        payload: JSON, as it was appended.
        at: When the store wrote it, aware, UTC.
    """

    position: int
    kind: str
    payload: dict[str, Any]
    at: datetime


@dataclass(frozen=True, eq=False)
class PosteriorRecord:
    """What was believed about a person's reward before a query.

    Attributes:
        query_index: The query it was computed for.
        mean: Posterior mean of the weights, float64, shape `(d,)`.
        samples: Kept samples, float64, shape `(m, d)`.
        summary: JSON: diagnostics such as `r_hat`, `ess_bulk`, `acceptance`.
    """

    query_index: int
    mean: NDArray[np.float64]
    samples: NDArray[np.float64]
    summary: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class NewReport:
    """What a browser measured while a query was on its screen, to be kept.

    Attributes:
        query_index: The query that was shown.
        measures: JSON, as the browser sent it.
    """

    query_index: int
    measures: dict[str, Any]


@dataclass(frozen=True)
class MeasureRecord:
    """What a browser measured while a query was on its screen.

    Attributes:
        query_index: The query that was shown.
        measures: JSON, as the browser sent it.
        at: When the store wrote it, aware, UTC.
    """

    query_index: int
    measures: dict[str, Any]
    at: datetime
