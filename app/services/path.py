"""What a participant can cause on the way to the queries, between and after them: steps, breaks, stopping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from app.services import preparation
from app.services.runtime import LiveSession, Runtime
from app.services.study import Screen, screen_of
from app.store import PositionTakenError
from study_core.errors import SessionError
from study_core.path import (
    ConsentStep,
    Ending,
    PracticeStep,
    QuestionnaireStep,
    Step,
    questionnaire_of,
    text_of,
)
from study_core.questionnaire import Checked, Problem, check, is_right, screens_out
from study_core.session import (
    Action,
    AnswerTakenBack,
    BreakTaken,
    Event,
    LanguageChosen,
    SessionEnded,
    StepOutcome,
    StepTaken,
    can_take_back,
    next_action,
)
from study_core.study import Study

Form = Mapping[str, Sequence[str]]
"""The fields of a page as they were sent, each with all its values."""

ACCEPT = "accept"
"""Field of the consent page: `yes` or `no`."""


@dataclass(frozen=True)
class StepReceipt:
    """What became of a page that was sent.

    Attributes:
        screen: What comes next.
        problems: By item, what has to be mended first; then nothing was recorded.
    """

    screen: Screen
    problems: dict[str, Problem] = field(default_factory=dict)


def take_step(runtime: Runtime, session_id: str, step: int, form: Form, n_tries: int = 0) -> StepReceipt:
    """Takes a page of the path; one that was taken before, or isn't the current one, changes nothing.

    Args:
        runtime: The services' resources.
        session_id: Whose page.
        step: Place of the step in the path, as the page knew it.
        form: What the person filled in.
        n_tries: How often its check had been tried before, as the page knew it; a page that is sent twice is one try.
    """
    live = runtime.live(session_id)
    with live.lock:
        is_at_a_step = next_action(live.study, live.state) is Action.STEP
        if not is_at_a_step or (live.state.step, live.state.n_tries) != (step, n_tries):
            return StepReceipt(screen_of(live))
        current = live.study.file.path[step]
        checked = _check(live.study, current, form)
        if checked.problems:
            return StepReceipt(screen_of(live), checked.problems)
        outcome = _outcome(live, current, form, checked.values)
        content = {"read": _read(live, current), **({"answers": checked.values} if checked.values else {})}
        _append(runtime, live, StepTaken(step, outcome, content))
        preparation.prepare(runtime, live)
        receipt = StepReceipt(screen_of(live))
    runtime.on_change(session_id)
    return receipt


def end_break(runtime: Runtime, session_id: str, query_index: int) -> Screen:
    """Goes on after the break before a query; doing it twice changes nothing."""
    return _cause(runtime, session_id, BreakTaken(query_index))


def take_back(runtime: Runtime, session_id: str, query_index: int) -> Screen:
    """Takes the last answer back, if it is the one to that query; the log keeps it."""
    live = runtime.live(session_id)
    with live.lock:
        if can_take_back(live.study, live.state) and query_index == live.state.query_index - 1:
            for computation in live.ahead.values():
                computation.cancel()
            live.ahead = {}
            _append(runtime, live, AnswerTakenBack(query_index))
            preparation.look_ahead(runtime, live)
        screen = screen_of(live)
    runtime.on_change(session_id)
    return screen


def choose_language(runtime: Runtime, session_id: str, language: str) -> Screen:
    """Goes on in another of the study's languages; any other changes nothing."""
    live = runtime.live(session_id)
    if language == language_of(live):
        return screen_of(live)
    return _cause(runtime, session_id, LanguageChosen(language))


def language_of(live: LiveSession) -> str:
    """Returns the language that a session is read in."""
    return live.state.language or live.study.languages[0]


def end(runtime: Runtime, session_id: str, ending: Ending) -> Screen:
    """Ends a session before its path does, and keeps the answers; one that is over stays as it ended.

    Args:
        runtime: The services' resources.
        session_id: Which.
        ending: `stopped` or `timed-out`.
    """
    return _cause(runtime, session_id, SessionEnded(ending))


def _cause(runtime: Runtime, session_id: str, event: Event) -> Screen:
    """Appends an event where it is possible; where it isn't, it comes late or twice."""
    live = runtime.live(session_id)
    with live.lock:
        with suppress(SessionError):
            _append(runtime, live, event)
        screen = screen_of(live)
    runtime.on_change(session_id)
    return screen


def _append(runtime: Runtime, live: LiveSession, event: Event) -> None:
    # Another process was first: the live state has been read again, and says what to show.
    with suppress(PositionTakenError):
        runtime.append(live, [event])


def _check(study: Study, step: Step, form: Form) -> Checked:
    name = questionnaire_of(step)
    return Checked() if name is None else check(study.file.questionnaire[name], form)


def _outcome(live: LiveSession, step: Step, form: Form, answers: Mapping[str, Any]) -> StepOutcome:
    if isinstance(step, ConsentStep):
        return StepOutcome.DONE if form.get(ACCEPT) == ["yes"] else StepOutcome.DECLINED
    if isinstance(step, PracticeStep) and step.check is not None:
        if is_right(live.study.file.questionnaire[step.check], answers):
            return StepOutcome.DONE
        return StepOutcome.FAILED if live.state.n_tries + 1 >= step.chances else StepOutcome.AGAIN
    if isinstance(step, QuestionnaireStep) and screens_out(
        live.study.file.questionnaire[step.questionnaire], answers
    ):
        return StepOutcome.SCREENED_OUT
    return StepOutcome.DONE


def _read(live: LiveSession, step: Step) -> dict[str, str]:
    """Returns what exactly the person had before them: the study's hash says the rest."""
    name, language = text_of(step), language_of(live)
    read = {"study_hash": live.study.hash, "language": language}
    if name is not None:
        read["text_sha256"] = live.study.text_hash(name, language)
    return read
