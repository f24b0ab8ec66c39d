"""A session's pages and their JSON API, below its own secret address."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response, StreamingResponse

from app.services import study as services
from app.services.path import language_of
from app.web.access import ThisSession
from app.web.pages import templates
from app.web.parts import SiteParts
from app.web.screens import screen_events
from app.web.trial import trial_context
from app.web.welcome import welcome_page


def participant_routes(parts: SiteParts) -> APIRouter:
    """Returns the routes below `/s/{token}/`, the stage's apart."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.get("/")
    def page(request: Request, session: ThisSession) -> Response:
        screen = services.screen(runtime, session.id)
        study = runtime.live(session.id).study
        if screen.kind == "welcome":
            return welcome_page(request, study)
        language = language_of(runtime.live(session.id))
        context = trial_context(study, language, screen)
        return templates.TemplateResponse(request, "participant.html", context)

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

    return router
