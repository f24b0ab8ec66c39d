"""The trial's page and JSON API: the question, its answer, taking it back, the end of a break."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict

from app.services import path
from app.services import study as services
from app.services.path import language_of
from app.services.runtime import LiveSession
from app.services.study import Screen
from app.web.access import ThisSession
from app.web.markdown import render_markdown
from app.web.parts import SiteParts
from app.web.session_page import session_page
from study_core.path import QueriesStep, text_of


class AnswerBody(BaseModel):
    """An answer as the page sends it: positions, not A or B; `client` is what the browser measured."""

    model_config = ConfigDict(extra="forbid", strict=True)

    query_index: int
    choice: str
    response_time_ms: int
    confidence: int | None = None
    client: dict[str, Any] | None = None


class QueryBody(BaseModel):
    """Which query the page means: so a request that comes late or twice changes nothing."""

    model_config = ConfigDict(extra="forbid", strict=True)

    query_index: int


def trial_page(request: Request, live: LiveSession, screen: Screen) -> Response:
    """Returns the page of the queries.

    Args:
        request: Whom it answers.
        live: The session.
        screen: What the page shows first.
    """
    study, language = live.study, language_of(live)
    current = study.file.path[screen.step]
    pause = text_of(current) if isinstance(current, QueriesStep) else None
    context = {
        "question": study.text_named("question", language).strip(),
        "screen": asdict(screen),
        "settings": {
            **study.file.answering.model_dump(),
            "answers": [str(choice) for choice in study.answers],
        },
        "break_text": "" if pause is None else render_markdown(study.text_named(pause, language)),
    }
    return session_page(request, live, "participant.html", context)


def trial_routes(parts: SiteParts) -> APIRouter:
    """Returns the trial's routes below `/s/{token}/`; each answers with the screen that comes next."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.post("/answer")
    def answer(session: ThisSession, body: AnswerBody) -> dict[str, Any]:
        choice = services.choice_behind(runtime, session.id, body.query_index, body.choice)
        receipt = services.answer(
            runtime,
            session.id,
            body.query_index,
            choice,
            body.response_time_ms,
            body.client,
            body.confidence,
        )
        return {"outcome": receipt.outcome.value, "screen": asdict(receipt.screen)}

    @router.post("/take-back")
    def take_back(session: ThisSession, body: QueryBody) -> dict[str, Any]:
        return {"screen": asdict(path.take_back(runtime, session.id, body.query_index))}

    @router.post("/break")
    def end_break(session: ThisSession, body: QueryBody) -> dict[str, Any]:
        return {"screen": asdict(path.end_break(runtime, session.id, body.query_index))}

    return router
