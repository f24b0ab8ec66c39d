"""What goes into the store and comes out of it: frozen plain data, never an ORM row."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Source(StrEnum):
    """Where a session comes from.

    JOINED is a participant of ours, REHEARSED a simulated or scripted person, IMPORTED a participant of a study that
    another program ran.
    """

    JOINED = "joined"
    REHEARSED = "rehearsed"
    IMPORTED = "imported"


@dataclass(frozen=True)
class SessionRecord:
    """One person's run through a study.

    Attributes:
        id: Random name of the session, a uuid4 in 32 hexadecimal digits.
        study_hash: Names the study text the session was created under.
        ordinal: The session's number within its study, from 1; seeds the session's random streams.
        source: Where it comes from.
        created_at: When it was created, aware, UTC.
    """

    id: str
    study_hash: str
    ordinal: int
    source: Source
    created_at: datetime


@dataclass(frozen=True)
class StudyRecord:
    """A text under which sessions were created.

    Attributes:
        study_hash: SHA-256 of the text, in hex.
        name: The study's name.
        version: SHA-256 of the study file's text, in hex: the same for all its conditions.
        condition: The condition that the text is of; None where the file has none.
        created_at: When it was first kept, aware, UTC.
    """

    study_hash: str
    name: str
    version: str
    condition: str | None
    created_at: datetime


@dataclass(frozen=True)
class ExternalPerson:
    """Who somebody is to the service or experimenter that sent them.

    Attributes:
        study_name: The study, whatever the version.
        external_id: The name that tells people apart, such as Prolific's `PROLIFIC_PID`; at most 200 characters.
        other_ids: What else the link said, such as Prolific's `STUDY_ID` and `SESSION_ID`.
    """

    study_name: str
    external_id: str
    other_ids: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class NewEvent:
    """Something that has happened and is to be put in the log.

    Attributes:
        kind: Past tense, such as `answer_given`.
        payload: JSON; `answer_given`, `query_prepared` and `answer_taken_back` carry an integer `query_index`.
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
        summary: JSON: diagnostics such as `r_hat`, `ess_bulk`, `acceptance`, and quantiles of the response parameters.
        parameters: Rationality, lapse rate and tie threshold of each sample, float64, shape `(m, 3)`; None where all
            samples have those that the summary names, and in what was kept before they were.
    """

    query_index: int
    mean: NDArray[np.float64]
    samples: NDArray[np.float64]
    summary: dict[str, Any] = field(default_factory=dict)
    parameters: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class ImportedSession:
    """A whole session that another program ran, to be kept.

    Attributes:
        digest: SHA-256 of what it was read from, in hex; the same digest is kept once.
        study_hash: Names the study text.
        study_name: The study's name.
        study_text: The study text.
        events: The log, in order.
        posteriors: The posteriors from which its queries were chosen.
    """

    digest: str
    study_hash: str
    study_name: str
    study_text: str
    events: tuple[NewEvent, ...]
    posteriors: tuple[PosteriorRecord, ...]


@dataclass(frozen=True)
class ModelRecord:
    """What a predictor has learned.

    Attributes:
        kind: Which predictor, such as `personal-network`.
        key: Hash of everything the model was computed from; another key is another model.
        content: The model, as its predictor writes it.
        lineage: JSON: what it was computed from and by what.
    """

    kind: str
    key: str
    content: bytes
    lineage: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Standing:
    """Where a session stands, as far as its log says.

    Attributes:
        step: Place in the path, from 0.
        n_answers: Answers that stand, practice among them.
        test_answers: The answers to the common test queries so far, one letter each: `a`, `b`, or `-` for neither.
        n_repeats: Repeated queries answered.
        n_repeats_agreed: Those of them answered as the first time.
        n_checks: Checks answered.
        n_checks_passed: Those of them answered as told.
        n_sided: Answers that chose a side, to queries whose sides are known.
        n_first: Those of them that chose what stood first.
        response_ms: Sum of all response times.
        is_wait: Whether the last thing that happened is a question that somebody had to wait for.
        focus_losses: How often a browser's page was hidden during the last answer.
        r_hat: The worst of the last posterior; None without a new one.
        ess: The least effective sample size of the last posterior; None without a new one.
        mean: The last posterior's mean, shape `(d,)`; None without a new one.
    """

    step: int
    n_answers: int
    test_answers: str
    n_repeats: int
    n_repeats_agreed: int
    n_checks: int
    n_checks_passed: int
    n_sided: int
    n_first: int
    response_ms: int
    is_wait: bool = False
    focus_losses: int = 0
    r_hat: float | None = None
    ess: float | None = None
    mean: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Deletion:
    """What deleting a person has removed.

    Attributes:
        session_ids: Their sessions, one or, where one had become too old, several.
        n_answers: Answers of the person.
        n_personal_models: Models of that person alone.
        n_shared_models: Models that had learned from the person among others.
        is_wiped: Whether nothing of it is left in the database's files; not so while another program reads an older
            state of a SQLite database, nor on a server that keeps its files itself.
    """

    session_ids: tuple[str, ...]
    n_answers: int
    n_personal_models: int
    n_shared_models: int
    is_wiped: bool


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
