"""What a participant can cause: join, begin, see the screen, answer. The path around that is in `path`."""

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
from app.services.duration import minutes_left
from app.services.runtime import LiveSession, Runtime
from app.services.tokens import hash_token, new_token
from app.store import NewReport, PopulationWithdrawnError, PositionTakenError, SessionRecord, Source
from study_core.comparison import Choice
from study_core.events import MOST_CONFIDENT, AnswerGiven, PopulationAdopted, SessionBegun
from study_core.path import PracticeStep
from study_core.plan import Position, choice_at
from study_core.queries import Participant
from study_core.session import (
    Action,
    apply,
    can_take_back,
    current_step,
    needs_query,
    next_action,
)
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
        kind: `welcome`, `step`, `preparing`, `question`, `break` or `finished`.
        position: Length of the session's log; a page ignores what is older than it has shown.
        step: Place in the path, from 0.
        query_index: The query on the stage, for a question; the one after it, for a break.
        number: Its number for people, from 1: among those for practice, or among all others.
        total: How many there are of these.
        is_practice: Whether it is for practice.
        instructed: The position that a check asks people to choose.
        minutes_left: About how long everything that is left will take; None before there is an answer to go by.
        can_take_back: Whether the last answer can be taken back.
    """

    kind: str
    position: int
    step: int
    query_index: int | None
    number: int
    total: int
    is_practice: bool
    instructed: Position | None
    minutes_left: int | None
    can_take_back: bool


_SCREEN_KINDS = {
    Action.WELCOME: "welcome",
    Action.STEP: "step",
    Action.PREPARE: "preparing",
    Action.BREAK: "break",
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
        return screen_of(live)


def screen(runtime: Runtime, session_id: str) -> Screen:
    """Returns what the participant should see, and sets going whatever that needs after a restart."""
    live = runtime.live(session_id)
    with live.lock:
        preparation.go_on(runtime, live)
        return screen_of(live)


def answer(
    runtime: Runtime,
    session_id: str,
    query_index: int,
    choice: str,
    response_time_ms: int,
    measures: dict[str, Any] | None = None,
    confidence: int | None = None,
) -> AnswerReceipt:
    """Takes an answer: durable when this returns, exactly once, with the next query if it is ready.

    Args:
        runtime: The services' resources.
        session_id: Whose answer.
        query_index: The query it answers.
        choice: One that the study offers, such as `a` or `b`.
        response_time_ms: As measured in the browser.
        measures: What else the browser measured, kept beside the log.
        confidence: From 1 to 5, where the study asks it.

    Raises:
        InvalidAnswerError: The study doesn't offer the choice, or asks for more or less, or the response time is
            impossible.
    """
    live = runtime.live(session_id)
    given = _checked(live.study, query_index, choice, response_time_ms, confidence)
    with live.lock:
        refused = _refusal(live, query_index)
        if refused is not None:
            return AnswerReceipt(refused, screen_of(live))
        try:
            continuation, pending = _take_whatever_is_withdrawn(runtime, live, given, measures)
        except PositionTakenError:
            return AnswerReceipt(_refusal(live, query_index) or Outcome.NOT_CURRENT, screen_of(live))
        if pending is not None:
            preparation.deliver_when_done(runtime, live, pending)
        receipt = AnswerReceipt(Outcome.TAKEN, screen_of(live))
    if continuation is not None:
        preparation.announce(runtime, live, continuation)
    else:
        runtime.on_change(session_id)
    if query_index == live.study.n_queries - 1:
        _learn_from(runtime, live)
    return receipt


def choice_behind(runtime: Runtime, session_id: str, query_index: int, shown: str) -> str:
    """Returns the answer meant by what a page sends: positions name the trajectories that stand there.

    Args:
        runtime: The services' resources.
        session_id: Whose page.
        query_index: The query that the page shows.
        shown: `first`, `second`, or an answer that names no position.

    Raises:
        InvalidAnswerError: It names a trajectory, which no page knows.
    """
    if shown in (Choice.A, Choice.B):
        raise InvalidAnswerError(f"Expected a position, first or second, got {shown!r}.")
    if shown not in set(Position):
        return shown
    prepared = runtime.live(session_id).state.prepared
    if not 0 <= query_index < len(prepared):
        # Whatever it chose, an answer to a query that nobody has been shown is refused where answers are taken.
        return Choice.A.value
    return choice_at(prepared[query_index].side_shown_first, Position(shown)).value


def _learn_from(runtime: Runtime, live: LiveSession) -> None:
    if runtime.trainer is not None:
        runtime.trainer.begin(live.record.id)
    if runtime.populations is not None:
        runtime.populations.begin(live.study)


def _checked(
    study: Study, query_index: int, choice: str, response_time_ms: int, confidence: int | None
) -> AnswerGiven:
    if choice not in study.answers:
        offered = " or ".join(f"'{each}'" for each in study.answers)
        raise InvalidAnswerError(f"Expected the choice {offered}, got {choice!r}.")
    if not 0 <= response_time_ms <= _LONGEST_RESPONSE_MS:
        raise InvalidAnswerError(
            f"Expected a response time from 0 to {_LONGEST_RESPONSE_MS} ms, got {response_time_ms}."
        )
    if confidence is not None and not 1 <= confidence <= MOST_CONFIDENT:
        raise InvalidAnswerError(f"Expected a confidence from 1 to {MOST_CONFIDENT}, got {confidence}.")
    # Nobody can be more or less sure of an answer that names no preference.
    is_asked = study.file.answering.confidence and choice not in (Choice.UNSURE, Choice.SKIP)
    if (confidence is not None) != is_asked:
        wanted = "a confidence" if is_asked else "no confidence"
        raise InvalidAnswerError(f"Expected {wanted} with the answer {choice!r}, got {confidence}.")
    return AnswerGiven(query_index, Choice(choice), response_time_ms, confidence)


def _refusal(live: LiveSession, query_index: int) -> Outcome | None:
    """Returns why an answer to that query can't be taken now, or None if it can."""
    if 0 <= query_index < len(live.state.answers):
        return Outcome.ALREADY_TAKEN
    is_asked = next_action(live.study, live.state) is Action.ASK
    return None if is_asked and live.state.query_index == query_index else Outcome.NOT_CURRENT


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
    if not needs_query(live.study, after):
        runtime.append(live, [given], report=report)
        live.ahead = {}
        return None, None
    computation = preparation.continuation_after(runtime, live, given.choice, after)
    if not has_succeeded(computation):
        runtime.append(live, [given], report=report)
        return None, computation
    continuation: Continuation = computation.result()
    events, posterior = preparation.entry(continuation)
    runtime.append(live, [given, *events], posterior, report)
    return continuation, None


def screen_of(live: LiveSession) -> Screen:
    """Returns what a session's participant should see; the caller holds its lock."""
    study, state = live.study, live.state
    kind = _SCREEN_KINDS[next_action(study, state)]
    is_practice = isinstance(current_step(study, state), PracticeStep)
    n_before = 0 if is_practice else study.n_practice
    total = study.n_practice if is_practice else study.n_queries - study.n_practice
    current = state.current
    return Screen(
        kind=kind,
        position=state.n_events,
        step=state.step,
        query_index=state.query_index if kind in ("question", "break") else None,
        number=min(max(state.query_index - n_before + 1, 1), total),
        total=total,
        is_practice=is_practice,
        instructed=None if current is None else current.instructed,
        minutes_left=minutes_left(study, state),
        can_take_back=can_take_back(study, state),
    )
