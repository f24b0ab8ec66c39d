"""Walks a person who isn't at a browser down the whole path of a study, by the same services."""

from __future__ import annotations

from collections.abc import Callable

from app.errors import AppError
from app.services import path
from app.services import study as services
from app.services.runtime import Runtime
from study_core.events import AnswerGiven, QueryPrepared
from study_core.path import questionnaire_of
from study_core.questionnaire import example_answer
from study_core.session import current_step

Answerer = Callable[[QueryPrepared], AnswerGiven]
"""Takes a prepared query; gives the answer to it, with a response time."""


class QueryFailedError(AppError):
    """A query could not be computed; the log says why."""


def walk(
    runtime: Runtime, session_id: str, answer: Answerer, on_answer: Callable[[], None] = lambda: None
) -> None:
    """Takes every step of a session's path and answers every query, until it is finished.

    Raises:
        QueryFailedError: The session can't go on.
    """
    screen = services.screen(runtime, session_id)
    while screen.kind != "finished":
        if screen.kind == "question":
            screen = _answer(runtime, session_id, answer)
            on_answer()
        elif screen.kind == "break":
            assert screen.query_index is not None, "a break comes before a query"
            screen = path.end_break(runtime, session_id, screen.query_index)
        elif screen.kind == "step":
            screen = path.take_step(runtime, session_id, screen.step, _filled_in(runtime, session_id)).screen
        else:
            raise QueryFailedError(f"Query {screen.number} could not be computed; the log above says why.")


def _answer(runtime: Runtime, session_id: str, answer: Answerer) -> services.Screen:
    given = answer(runtime.live(session_id).state.prepared[-1])
    assert given.response_time_ms is not None, "who walks through a session takes some time"
    return services.answer(
        runtime,
        session_id,
        given.query_index,
        given.choice.value,
        given.response_time_ms,
        confidence=given.confidence,
    ).screen


def _filled_in(runtime: Runtime, session_id: str) -> path.Form:
    """Returns the page of a person who agrees, has understood and tells nothing else about themselves."""
    live = runtime.live(session_id)
    step = current_step(live.study, live.state)
    name = None if step is None else questionnaire_of(step)
    items = () if name is None else live.study.file.questionnaire[name]
    return {path.ACCEPT: ["yes"], **{item.name: [example_answer(item)] for item in items}}
