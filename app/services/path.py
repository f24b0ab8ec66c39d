"""What a participant can cause on the way to the queries, between and after them: steps, breaks, stopping."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from app.services import preparation
from app.services.runtime import LiveSession, Runtime
from app.services.study import Screen, screen_of
from app.store import PositionTakenError
from study_core.events import (
    AnswerTakenBack,
    BreakTaken,
    Event,
    LanguageChosen,
    SessionEnded,
    SessionReopened,
    StepOutcome,
    StepTaken,
)
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
from study_core.session import Action, can_be_reopened, can_take_back, next_action
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
    problems: dict[str, Problem] = {}

    def taken(live: LiveSession) -> StepTaken | None:
        is_at_a_step = next_action(live.study, live.state) is Action.STEP
        if not is_at_a_step or (live.state.step, live.state.n_tries) != (step, n_tries):
            return None
        current = live.study.file.path[step]
        checked = _check(live.study, current, form)
        problems.update(checked.problems)
        if problems:
            return None
        outcome = _outcome(live, current, form, checked.values)
        answers = {"answers": checked.values} if checked.values else {}
        return StepTaken(step, outcome, {"read": _read(live, current), **answers})

    return StepReceipt(_cause(runtime, session_id, taken), problems)


def end_break(runtime: Runtime, session_id: str, query_index: int) -> Screen:
    """Goes on after the break before a query; doing it twice changes nothing."""

    def ended(live: LiveSession) -> BreakTaken | None:
        is_break = next_action(live.study, live.state) is Action.BREAK
        return BreakTaken(query_index) if is_break and live.state.query_index == query_index else None

    return _cause(runtime, session_id, ended)


def take_back(runtime: Runtime, session_id: str, query_index: int) -> Screen:
    """Takes the last answer back, if it is the one to that query; the log keeps it."""

    def taken_back(live: LiveSession) -> AnswerTakenBack | None:
        is_last = query_index == live.state.query_index - 1
        return AnswerTakenBack(query_index) if is_last and can_take_back(live.study, live.state) else None

    return _cause(runtime, session_id, taken_back)


def choose_language(runtime: Runtime, session_id: str, language: str) -> Screen:
    """Goes on in another of the study's languages; any other changes nothing."""

    def chosen(live: LiveSession) -> LanguageChosen | None:
        is_new = language in live.study.languages and language != language_of(live)
        return LanguageChosen(language) if is_new and live.state.ending is None else None

    return _cause(runtime, session_id, chosen)


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

    def ended(live: LiveSession) -> SessionEnded | None:
        return SessionEnded(ending) if live.state.ending is None else None

    return _cause(runtime, session_id, ended)


def reopen(runtime: Runtime, session_id: str) -> Screen:
    """Lets somebody go on whose session has ended before its path does; one that can't be reopened stays as it is."""

    def reopened(live: LiveSession) -> SessionReopened | None:
        return SessionReopened() if can_be_reopened(live.state) else None

    return _cause(runtime, session_id, reopened)


def _cause(runtime: Runtime, session_id: str, due: Callable[[LiveSession], Event | None]) -> Screen:
    """Appends the event that is due in a session's state, if one is; one that comes late or twice isn't.

    Args:
        runtime: The services' resources.
        session_id: Which session.
        due: Returns the event, or None; asked again where the state turns out to be another.
    """
    live = runtime.live(session_id)
    with live.lock:
        while (event := due(live)) is not None:
            # Another process may be first, or somebody before be deleted: then the state has been read again.
            with suppress(PositionTakenError):
                runtime.append(live, [event])
                if isinstance(event, AnswerTakenBack | SessionEnded):
                    preparation.give_up(live)
                break
        if live.state.participant is not None:
            preparation.go_on(runtime, live)
        screen = screen_of(live)
    runtime.on_change(session_id)
    return screen


def _check(study: Study, step: Step, form: Form) -> Checked:
    if isinstance(step, ConsentStep) and form.get(ACCEPT) not in (["yes"], ["no"]):
        return Checked(problems={ACCEPT: Problem.MISSING})
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
