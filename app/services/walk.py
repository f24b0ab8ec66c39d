"""Walks a person who isn't at a browser down the whole path of a study, by the same services."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.errors import AppError
from app.services import path
from app.services import study as services
from app.services.runtime import LiveSession, Runtime
from study_core.events import AnswerGiven, QueryPrepared
from study_core.path import Ending, Item, questionnaire_of
from study_core.questionnaire import example_answer
from study_core.session import current_step

Answerer = Callable[[QueryPrepared], AnswerGiven | None]
"""Takes a prepared query; gives the answer to it, with a response time. None for somebody who stops there."""

Fill = Callable[[LiveSession], path.Form]
"""Takes a session that is at a page of its path; gives what the person fills in."""


def agree(live: LiveSession) -> path.Form:
    """Returns the page of a person who agrees, has understood and tells nothing else about themselves."""
    return {path.ACCEPT: ["yes"], **{item.name: [example_answer(item)] for item in items_at(live)}}


def items_at(live: LiveSession) -> Sequence[Item]:
    """Returns the questions of the page that a session is at."""
    step = current_step(live.study, live.state)
    name = None if step is None else questionnaire_of(step)
    return () if name is None else live.study.file.questionnaire[name]


class QueryFailedError(AppError):
    """A query could not be computed; the log says why."""


def walk(
    runtime: Runtime,
    session_id: str,
    answer: Answerer,
    on_answer: Callable[[], None] = lambda: None,
    fill: Fill = agree,
) -> None:
    """Takes every step of a session's path and answers every query, until it is finished or the person stops.

    Args:
        runtime: The services' resources.
        session_id: Whose.
        answer: Answers queries.
        on_answer: Called after each answer.
        fill: Fills in pages.

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
            screen = _take_step(runtime, session_id, screen.step, fill)
        else:
            raise QueryFailedError(f"Query {screen.number} could not be computed; the log above says why.")


def _take_step(runtime: Runtime, session_id: str, step: int, fill: Fill) -> services.Screen:
    n_tries = runtime.live(session_id).state.n_tries
    receipt = path.take_step(runtime, session_id, step, fill(runtime.live(session_id)), n_tries)
    assert not receipt.problems, f"whoever walks fills in pages as they must be: {receipt.problems}"
    return receipt.screen


def _answer(runtime: Runtime, session_id: str, answer: Answerer) -> services.Screen:
    given = answer(runtime.live(session_id).state.prepared[-1])
    if given is None:
        return path.end(runtime, session_id, Ending.STOPPED)
    assert given.response_time_ms is not None, "who walks through a session takes some time"
    return services.answer(
        runtime,
        session_id,
        given.query_index,
        given.choice.value,
        given.response_time_ms,
        confidence=given.confidence,
    ).screen
