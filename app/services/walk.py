"""Walks a person who isn't at a browser through a whole session, by the same services."""

from __future__ import annotations

from collections.abc import Callable

from app.errors import AppError
from app.services import study as services
from app.services.runtime import Runtime
from study_core.comparison import Choice
from study_core.session import QueryPrepared

Answerer = Callable[[QueryPrepared], tuple[Choice, int]]
"""Takes a prepared query; gives the choice and the response time in milliseconds."""


class QueryFailedError(AppError):
    """A query could not be computed; the log says why."""


def walk(
    runtime: Runtime, session_id: str, answer: Answerer, on_answer: Callable[[], None] = lambda: None
) -> None:
    """Answers every query of a session until it is finished.

    Raises:
        QueryFailedError: The session can't go on.
    """
    screen = services.screen(runtime, session_id)
    while screen.kind == "question":
        prepared = runtime.live(session_id).state.prepared[-1]
        choice, response_time_ms = answer(prepared)
        receipt = services.answer(runtime, session_id, prepared.query_index, choice.value, response_time_ms)
        screen = receipt.screen
        on_answer()
    if screen.kind != "finished":
        raise QueryFailedError(f"Query {screen.number} could not be computed; the log above says why.")
