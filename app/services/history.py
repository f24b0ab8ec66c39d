"""One person's session as it went: what happened when, what was asked and answered, and what was believed of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float

from app.services.monitor import step_name, study_of
from app.services.runtime import Runtime
from app.services.standing import least_ess, times_hidden, worst_r_hat
from app.store import EventRecord, PosteriorRecord
from study_core import session_codec
from study_core.events import (
    AnswerGiven,
    AnswerTakenBack,
    BreakTaken,
    Event,
    FeatureLearned,
    LanguageChosen,
    PopulationAdopted,
    QueryPrepared,
    SessionBegun,
    SessionEnded,
    SessionReopened,
    StepTaken,
)
from study_core.plan import Position, position_of
from study_core.study import Study

_INTERVAL = (0.05, 0.95)
# Written with the answer before: the clock moves between the two rows.
_AT_ONCE_S = 0.05


@dataclass(frozen=True)
class Moment:
    """Something that happened.

    Attributes:
        at: When, aware, UTC.
        what: In words.
    """

    at: datetime
    what: str


@dataclass(frozen=True)
class Asked:
    """A question that was asked.

    Attributes:
        query_index: From 0.
        phase: `practice`, `active` or `test`.
        choice: What was answered; empty while it isn't.
        place: Where what was chosen stood; None for an answer that names no side.
        response_s: How long the answer took; None where it isn't known.
        waited_s: How long the person waited for the question; None where it was there at once.
        repeat_of: The question that it asks again.
        has_agreed: For a repeat, whether it was answered as before; None otherwise.
        has_obeyed: For a check, whether it was answered as told; None otherwise.
        n_hidden: How often the page was hidden meanwhile.
    """

    query_index: int
    phase: str
    choice: str
    place: Position | None
    response_s: float | None
    waited_s: float | None
    repeat_of: int | None
    has_agreed: bool | None
    has_obeyed: bool | None
    n_hidden: int


@dataclass(frozen=True, eq=False)
class Belief:
    """What was believed before a question.

    Attributes:
        query_index: Before which.
        mean: Of each weight.
        low: Below it, 5 % of the samples.
        high: Above it, 5 %.
        r_hat: The worst; None where it isn't known.
        ess: The least; None where it isn't known.
    """

    query_index: int
    mean: Float[np.ndarray, " d"]
    low: Float[np.ndarray, " d"]
    high: Float[np.ndarray, " d"]
    r_hat: float | None
    ess: float | None


@dataclass(frozen=True)
class History:
    """A session as it went.

    Attributes:
        moments: What happened, in order; the answers between two other things are one.
        asked: Every question whose answer stands, and the one being asked.
        beliefs: By question, the last that holds for each.
        weight_names: Of all weights that the last belief has.
    """

    moments: tuple[Moment, ...]
    asked: tuple[Asked, ...]
    beliefs: tuple[Belief, ...]
    weight_names: tuple[str, ...]


def history_of(runtime: Runtime, session_id: str) -> History:
    """Returns a session's history.

    Raises:
        SessionDeletedError: It was deleted.
    """
    store = runtime.store
    study = study_of(runtime, store.session(session_id).study_hash)
    log = [
        (record, session_codec.from_json(record.kind, record.payload)) for record in store.events(session_id)
    ]
    hidden = _hidden(runtime, session_id)
    beliefs = tuple(_belief(posterior) for posterior in store.posteriors(session_id))
    names = () if study is None or not beliefs else study.weight_names[: len(beliefs[-1].mean)]
    return History(tuple(_moments(study, log)), tuple(_asked(log, hidden)), beliefs, names)


def _moments(study: Study | None, log: Sequence[tuple[EventRecord, Event]]) -> Iterator[Moment]:
    answered: list[tuple[datetime, int]] = []
    for record, event in log:
        if isinstance(event, AnswerGiven):
            answered.append((record.at, event.query_index))
        elif not isinstance(event, QueryPrepared):
            yield from _run(answered)
            answered = []
            yield Moment(record.at, _what(study, event))
    yield from _run(answered)


def _run(answered: Sequence[tuple[datetime, int]]) -> Iterator[Moment]:
    """Gives one moment for answers that followed each other."""
    if not answered:
        return
    first, (at, last) = answered[0][1] + 1, answered[-1]
    yield Moment(
        at,
        f"Answered question {first}" if len(answered) == 1 else f"Answered questions {first} to {last + 1}",
    )


def _what(study: Study | None, event: Event) -> str:
    match event:
        case SessionBegun():
            return "Began"
        case LanguageChosen(language=language):
            return f"Chose the language {language}"
        case StepTaken(step=step, outcome=outcome):
            name = f"Step {step + 1}" if study is None else step_name(study.file.path[step])
            return f"{name}: {outcome.value}"
        case BreakTaken(query_index=query_index):
            return f"Went on after the break before question {query_index + 1}"
        case AnswerTakenBack(query_index=query_index):
            return f"Took back the answer to question {query_index + 1}"
        case PopulationAdopted():
            return "Starts from what people before have in common"
        case FeatureLearned():
            return "A feature was learned from the answers so far"
        case SessionEnded(ending=ending):
            return f"Ended: {ending.value}"
        case SessionReopened():
            return "Reopened"
        case _:
            return session_codec.kind_of(event).replace("_", " ")


def _asked(log: Sequence[tuple[EventRecord, Event]], hidden: dict[int, int]) -> Iterator[Asked]:
    prepared: dict[int, QueryPrepared] = {}
    answers: dict[int, AnswerGiven] = {}
    waits: dict[int, float] = {}
    before: EventRecord | None = None
    for record, event in log:
        if isinstance(event, QueryPrepared):
            prepared[event.query_index] = event
            if before is not None and before.kind == session_codec.KINDS[AnswerGiven]:
                waits[event.query_index] = (record.at - before.at).total_seconds()
        elif isinstance(event, AnswerGiven):
            answers[event.query_index] = event
        elif isinstance(event, AnswerTakenBack):
            answers.pop(event.query_index, None)
        before = record
    for index, query in sorted(prepared.items()):
        given = answers.get(index)
        original = answers.get(query.repeat_of) if query.repeat_of is not None else None
        place = None if given is None else position_of(query.first_shown, given.choice)
        yield Asked(
            query_index=index,
            phase=query.phase.value,
            choice="" if given is None else given.choice.value,
            place=place,
            response_s=None
            if given is None or given.response_time_ms is None
            else given.response_time_ms / 1000.0,
            waited_s=waits[index] if waits.get(index, 0.0) > _AT_ONCE_S else None,
            repeat_of=query.repeat_of,
            has_agreed=None if original is None or given is None else given.choice is original.choice,
            has_obeyed=None if query.instructed is None or given is None else place is query.instructed,
            n_hidden=hidden.get(index, 0),
        )


def _hidden(runtime: Runtime, session_id: str) -> dict[int, int]:
    """Returns, by question, how often the page was hidden."""
    return {
        record.query_index: times_hidden(record.measures) for record in runtime.store.measures(session_id)
    }


def _belief(posterior: PosteriorRecord) -> Belief:
    low, high = np.quantile(posterior.samples, _INTERVAL, axis=0)
    return Belief(
        posterior.query_index, posterior.mean, low, high, worst_r_hat(posterior), least_ess(posterior)
    )
