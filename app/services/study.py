"""What a participant can cause: join, begin, see the screen, answer."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from app.errors import AppError
from app.services import population, preparation
from app.services.computations import has_succeeded
from app.services.continuation import Computation, Continuation
from app.services.runtime import LiveSession, Runtime
from app.services.tokens import hash_token, new_token
from app.store import NewReport, PopulationWithdrawnError, PositionTakenError, SessionRecord, Source
from study_core.comparison import Choice, Query
from study_core.queries import Participant
from study_core.session import Action, AnswerGiven, PopulationAdopted, SessionBegun, apply, next_action
from study_core.study import Study

# Nobody watches two five-second drives for a day; anything beyond is a clock gone wrong.
_LONGEST_RESPONSE_MS = 86_400_000


class InvalidAnswerError(AppError):
    """An answer that can't be one, whatever the query."""


class Outcome(StrEnum):
    """What became of an answer."""

    TAKEN = "taken"
    ALREADY_TAKEN = "already-taken"
    NOT_CURRENT = "not-current"


@dataclass(frozen=True)
class Screen:
    """What a participant should see.

    Attributes:
        kind: `welcome`, `preparing`, `question` or `finished`.
        position: Length of the session's log; a page ignores what is older than it has shown.
        query_index: The query on the stage, for a question.
        number: Its number for people, from 1.
        total: How many queries the session has.
    """

    kind: str
    position: int
    query_index: int | None
    number: int
    total: int


_SCREEN_KINDS = {
    Action.WELCOME: "welcome",
    Action.PREPARE: "preparing",
    Action.ASK: "question",
    Action.FINISHED: "finished",
}


@dataclass(frozen=True)
class AnswerReceipt:
    """What the participant is told about an answer: it is durable, and what comes next."""

    outcome: Outcome
    screen: Screen


AdoptFn = Callable[[Runtime, Study], PopulationAdopted | None]
"""Says which people before a session starts from, if from any."""


def adopt_stored(runtime: Runtime, study: Study) -> PopulationAdopted | None:
    """Returns what the store knows of the people before; None without any, or where the study wants none."""
    return population.adopted(runtime.store, study)


def join(
    runtime: Runtime, study: Study, rehearsal: Participant | None = None, adopt: AdoptFn = adopt_stored
) -> tuple[str, SessionRecord]:
    """Creates a session and begins it.

    Args:
        runtime: The services' resources.
        study: The study.
        rehearsal: For a simulated or scripted person: what names the session's random streams.
        adopt: Says which people before the session starts from.

    Returns:
        The session's secret token, known to nobody else, and its record.
    """
    opened = runtime.open_study(study)
    token = new_token()
    source = Source.JOINED if rehearsal is None else Source.REHEARSED
    record = runtime.store.create_session(opened.study.hash, hash_token(token), source)
    begin(runtime, record.id, rehearsal, adopt)
    return token, record


def find(runtime: Runtime, token: str) -> SessionRecord | None:
    """Returns the session that a secret link opens, or None."""
    return runtime.session_of_token(hash_token(token))


def find_known(runtime: Runtime, token: str) -> SessionRecord | None:
    """Returns what `find` has returned before, without waiting for the store; fit for an event loop."""
    return runtime.known_session(hash_token(token))


def begin(
    runtime: Runtime,
    session_id: str,
    participant: Participant | None = None,
    adopt: AdoptFn = adopt_stored,
) -> Screen:
    """Leaves the welcome page; doing it twice changes nothing. Streams are named by the ordinal unless told."""
    live = runtime.live(session_id)
    with live.lock:
        while next_action(live.study, live.state) is Action.WELCOME:
            people_before = adopt(runtime, live.study)
            begun = SessionBegun(participant or live.record.ordinal)
            # Somebody may be deleted between the reading of what they taught and this.
            with suppress(PopulationWithdrawnError):
                runtime.append(live, [begun] if people_before is None else [begun, people_before])
        preparation.prepare(runtime, live)
        return _screen(live)


def screen(runtime: Runtime, session_id: str) -> Screen:
    """Returns what the participant should see, and sets going whatever that needs after a restart."""
    live = runtime.live(session_id)
    with live.lock:
        preparation.prepare(runtime, live)
        if live.state.current is not None and not live.ahead:
            preparation.look_ahead(runtime, live)
        return _screen(live)


def answer(
    runtime: Runtime,
    session_id: str,
    query_index: int,
    choice: str,
    response_time_ms: int,
    measures: dict[str, Any] | None = None,
) -> AnswerReceipt:
    """Takes an answer: durable when this returns, exactly once, with the next query if it is ready.

    Args:
        runtime: The services' resources.
        session_id: Whose answer.
        query_index: The query it answers.
        choice: One that the study offers, such as `a` or `b`.
        response_time_ms: As measured in the browser.
        measures: What else the browser measured, kept beside the log.

    Raises:
        InvalidAnswerError: The study doesn't offer the choice, or the response time is impossible.
    """
    live = runtime.live(session_id)
    given = _checked(live.study, query_index, choice, response_time_ms)
    with live.lock:
        refused = _refusal(live, query_index)
        if refused is not None:
            return AnswerReceipt(refused, _screen(live))
        try:
            continuation, pending = _take_whatever_is_withdrawn(runtime, live, given, measures)
        except PositionTakenError:
            return AnswerReceipt(_refusal(live, query_index) or Outcome.NOT_CURRENT, _screen(live))
        if pending is not None:
            preparation.deliver_when_done(runtime, live, pending)
        receipt = AnswerReceipt(Outcome.TAKEN, _screen(live))
    if continuation is not None:
        preparation.announce(runtime, live, continuation)
    else:
        runtime.on_change(session_id)
    if receipt.screen.kind == "finished":
        _learn_from(runtime, live)
    return receipt


def _learn_from(runtime: Runtime, live: LiveSession) -> None:
    if runtime.trainer is not None:
        runtime.trainer.begin(live.record.id)
    if runtime.populations is not None:
        runtime.populations.begin(live.study)


def current_query(runtime: Runtime, session_id: str) -> tuple[Study, int, Query] | None:
    """Returns the study, index and query on the stage, or None."""
    live = runtime.live(session_id)
    with live.lock:
        current = live.state.current
        return None if current is None else (live.study, current.query_index, current.proposed.query)


def _checked(study: Study, query_index: int, choice: str, response_time_ms: int) -> AnswerGiven:
    if choice not in study.answers:
        offered = " or ".join(f"'{each}'" for each in study.answers)
        raise InvalidAnswerError(f"Expected the choice {offered}, got {choice!r}.")
    if not 0 <= response_time_ms <= _LONGEST_RESPONSE_MS:
        raise InvalidAnswerError(
            f"Expected a response time from 0 to {_LONGEST_RESPONSE_MS} ms, got {response_time_ms}."
        )
    return AnswerGiven(query_index, Choice(choice), response_time_ms)


def _refusal(live: LiveSession, query_index: int) -> Outcome | None:
    """Returns why an answer to that query can't be taken now, or None if it can."""
    if 0 <= query_index < len(live.state.answers):
        return Outcome.ALREADY_TAKEN
    current = live.state.current
    if current is None or current.query_index != query_index:
        return Outcome.NOT_CURRENT
    return None


def _take_whatever_is_withdrawn(
    runtime: Runtime, live: LiveSession, given: AnswerGiven, measures: dict[str, Any] | None
) -> tuple[Continuation | None, Computation | None]:
    """Takes the answer; if somebody before was deleted since the query was shown, goes on without what they taught."""
    try:
        return _take(runtime, live, given, measures)
    except PopulationWithdrawnError:
        return _take(runtime, live, given, measures)


def _take(
    runtime: Runtime, live: LiveSession, given: AnswerGiven, measures: dict[str, Any] | None
) -> tuple[Continuation | None, Computation | None]:
    """Appends the answer, together with the next query if it is there; returns it, or what it is waiting for."""
    report = NewReport(given.query_index, measures) if measures else None
    after = apply(live.study, live.state, given)
    if next_action(live.study, after) is not Action.PREPARE:
        runtime.append(live, [given], report=report)
        return None, None
    computation = preparation.continuation_after(runtime, live, given.choice, after)
    if not has_succeeded(computation):
        runtime.append(live, [given], report=report)
        return None, computation
    continuation: Continuation = computation.result()
    events, posterior = preparation.entry(continuation)
    runtime.append(live, [given, *events], posterior, report)
    return continuation, None


def _screen(live: LiveSession) -> Screen:
    state, total = live.state, live.study.protocol.n_queries
    kind = _SCREEN_KINDS[next_action(live.study, state)]
    index = state.query_index if kind == "question" else None
    return Screen(kind, state.n_events, index, min(state.query_index + 1, total), total)
