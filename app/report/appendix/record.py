"""One person as the appendix knows them: where they stand, what they filled in, what their browser measured."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

from app.store import PersonLine, SessionDeletedError, Source, Store
from study_core import session_codec
from study_core.events import AnswerGiven, Event, QueryPrepared, StepTaken
from study_core.study import Study, parse_study


@dataclass(frozen=True)
class PersonRecord:
    """Everything about one person that the appendix reports.

    Attributes:
        line: Where they stand, and what was decided about them.
        study: The study, in their condition.
        log: What happened, and when.
        measures: What their browser measured, a query each.
    """

    line: PersonLine
    study: Study
    log: tuple[tuple[datetime, Event], ...]
    measures: tuple[dict[str, Any], ...]

    @property
    def has_completed(self) -> bool:
        """Returns whether they went the whole path."""
        return self.line.ending == "completed"

    @property
    def is_analysed(self) -> bool:
        """Returns whether they completed, and nothing speaks against them."""
        return self.has_completed and self.line.review.verdict is None

    @property
    def minutes(self) -> float:
        """Returns how long it took them, from their first step to their last."""
        return (self.log[-1][0] - self.log[0][0]).total_seconds() / 60.0 if self.log else 0.0

    @cached_property
    def queries(self) -> list[QueryPrepared]:
        """Returns what they were asked, also what was taken back."""
        return [event for _, event in self.log if isinstance(event, QueryPrepared)]

    @cached_property
    def response_times_ms(self) -> list[int]:
        """Returns how long they took for each answer."""
        given = [event for _, event in self.log if isinstance(event, AnswerGiven)]
        return [event.response_time_ms for event in given if event.response_time_ms is not None]

    @cached_property
    def responses(self) -> dict[tuple[int, str], Any]:
        """Returns what they filled in last, by step of the path and item."""
        steps = [event for _, event in self.log if isinstance(event, StepTaken)]
        return {
            (step.step, item): value
            for step in steps
            for item, value in step.content.get("answers", {}).items()
        }


def read_people(store: Store, study_name: str, source: Source) -> list[PersonRecord]:
    """Returns everybody of a study who comes from there, oldest first."""
    records = []
    for line in store.person_lines(study_name):
        if line.session.source is not source:
            continue
        try:
            events = store.events(line.session.id)
            measures = store.measures(line.session.id)
        except SessionDeletedError:
            continue
        study = parse_study(store.study_text(line.session.study_hash))
        log = tuple((event.at, session_codec.from_json(event.kind, event.payload)) for event in events)
        records.append(PersonRecord(line, study, log, tuple(each.measures for each in measures)))
    return records
