"""A session's one address, which always shows where the person is; and the screens as they change."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response, StreamingResponse

from app.services import study as services
from app.services.joining import end_if_too_old, following_token
from app.web.access import ThisSession
from app.web.ending import ending_page
from app.web.parts import SiteParts
from app.web.screens import screen_events
from app.web.step_page import step_page
from app.web.trial import trial_page
from app.web.welcome import welcome_page


def participant_routes(parts: SiteParts) -> APIRouter:
    """Returns the routes of `/s/{token}/` itself; what its pages send has routes of its own."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.get("/")
    def page(request: Request, token: str, session: ThisSession) -> Response:
        end_if_too_old(runtime, session.id)
        screen = services.screen(runtime, session.id)
        live = runtime.live(session.id)
        if screen.kind == "welcome":
            return welcome_page(request, live.study)
        if screen.kind == "step":
            return step_page(request, runtime, session.id, screen.step)
        if screen.kind == "finished":
            following = following_token(runtime, token)
            return ending_page(request, live) if following is None else _to(following)
        return trial_page(request, live, screen)

    @router.post("/")
    def begin(token: str, session: ThisSession) -> Response:
        services.begin(runtime, session.id)
        return _to(token)

    @router.get("/screens")
    async def screens(session: ThisSession) -> Response:
        events = screen_events(runtime, session.id, parts.changes, parts.n_viewers)
        # A proxy in front must pass each event on at once.
        headers = {"X-Accel-Buffering": "no"}
        return StreamingResponse(events, headers=headers, media_type="text/event-stream")

    return router


def _to(token: str) -> Response:
    return RedirectResponse(f"/s/{token}/", status_code=303)
