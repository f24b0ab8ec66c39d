"""What people taught, read back for learning: their active answers, and never one to a test query.

Test answers can't come this way: what is asked of the store is `ActiveAnswers`, which has no method that reads one, and
the store itself isn't imported. For the evaluation they are in `app.services.held_out`, which nothing that learns may
import.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from app.store.records import EventRecord, PosteriorRecord, SessionRecord
from study_core import session_codec
from study_core.events import Event, SessionBegun
from study_core.plan import Phase
from study_core.predictors.predictor import Training
from study_core.preferences import preferences
from study_core.queries import Participant
from study_core.study import Study, parse_study


class ActiveAnswers(Protocol):
    """The part of a `Store` that learning sees."""

    def study_text(self, study_hash: str) -> str:
        """See `Store`."""
        ...

    def active_events(self, session_id: str, n_active: int) -> tuple[EventRecord, ...]:
        """See `Store`."""
        ...

    def n_answers(self, session_id: str) -> int:
        """See `Store`."""
        ...

    def posteriors(self, session_id: str) -> tuple[PosteriorRecord, ...]:
        """See `Store`."""
        ...


@dataclass(frozen=True)
class Person:
    """What is known of one person, as far as learning may know it.

    Attributes:
        session_id: The person's session.
        study: The study that the session was created under.
        participant: Names the session's random streams; None before it has begun.
        training: What their active answers taught.
    """

    session_id: str
    study: Study
    participant: Participant | None
    training: Training


def person(answers: ActiveAnswers, record: SessionRecord) -> Person:
    """Returns what a finished or running session taught so far."""
    study = study_of(answers, record)
    stored = answers.active_events(record.id, study.first_test)
    events = [session_codec.from_json(event.kind, event.payload) for event in stored]
    begun = next((event for event in events if isinstance(event, SessionBegun)), None)
    participant = None if begun is None else begun.participant
    return Person(record.id, study, participant, _training(answers, record, study, events))


def is_finished(answers: ActiveAnswers, record: SessionRecord) -> bool:
    """Returns whether every query of a session is answered."""
    return answers.n_answers(record.id) == study_of(answers, record).n_queries


def study_of(answers: ActiveAnswers, record: SessionRecord) -> Study:
    """Returns the study that a session was created under."""
    return parse_study(answers.study_text(record.study_hash))


def _training(answers: ActiveAnswers, record: SessionRecord, study: Study, events: list[Event]) -> Training:
    pairs, signs = preferences(study.domain, events, Phase.ACTIVE)
    posteriors = answers.posteriors(record.id)
    # Test answers don't inform the posterior, so the last one knows of active answers alone. (An imported person's
    # doesn't know the very last of those; their study kept none that does.)
    mean = posteriors[-1].mean if posteriors else None
    # With a learned feature among them, the weights aren't those of the hand-coded features alone.
    is_hand_coded = mean is not None and len(mean) == len(study.domain.feature_names)
    return Training(pairs, signs, mean if is_hand_coded else None)
