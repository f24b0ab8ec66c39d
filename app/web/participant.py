"""A session's pages and their JSON API, below its own secret address."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response, StreamingResponse
from pydantic import BaseModel, ConfigDict

from app.services import study as services
from app.services.path import language_of
from app.services.runtime import LiveSession
from app.services.study import Screen
from app.web.access import ThisSession
from app.web.markdown import render_markdown
from app.web.parts import SiteParts
from app.web.screens import screen_events
from app.web.session_page import session_page
from app.web.ending import ending_page
from app.web.step_page import step_page
from app.web.welcome import welcome_page
from study_core.path import QueriesStep, text_of

class AnswerBody(BaseModel):
    """An answer as the page sends it: positions, not A or B; `client` is what the browser measured."""

    model_config = ConfigDict(extra="forbid", strict=True)

    query_index: int
    choice: str
    response_time_ms: int
    confidence: int | None = None
    client: dict[str, Any] | None = None


def participant_routes(parts: SiteParts) -> APIRouter:
    """Returns the routes below `/s/{token}/`, the stage's apart."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.get("/")
    def page(request: Request, session: ThisSession) -> Response:
        screen = services.screen(runtime, session.id)
        live = runtime.live(session.id)
        if screen.kind == "welcome":
            return welcome_page(request, live.study)
        if screen.kind == "step":
            return step_page(request, runtime, session.id, screen.step)
        if screen.kind == "finished":
            return ending_page(request, live)
        return session_page(request, live, "participant.html", _trial(live, screen))

    @router.post("/")
    def begin(token: str, session: ThisSession) -> Response:
        services.begin(runtime, session.id)
        return RedirectResponse(f"/s/{token}/", status_code=303)

    @router.get("/screens")
    async def screens(session: ThisSession) -> Response:
        events = screen_events(runtime, session.id, parts.changes, parts.n_viewers)
        # A proxy in front must pass each event on at once.
        headers = {"X-Accel-Buffering": "no"}
        return StreamingResponse(events, headers=headers, media_type="text/event-stream")

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

    return router


def _trial(live: LiveSession, screen: Screen) -> dict[str, Any]:
    """Returns what the page of the queries says and offers."""
    study, language = live.study, language_of(live)
    answering = study.file.answering
    current = study.file.path[screen.step]
    pause = text_of(current) if isinstance(current, QueriesStep) else None
    return {
        "question": study.text_named("question", language).strip(),
        "screen": asdict(screen),
        "settings": {**answering.model_dump(), "answers": [choice.value for choice in study.answers]},
        "break_text": "" if pause is None else render_markdown(study.text_named(pause, language)),
    }
