"""The way in: from a study's link to a session's own address."""

from __future__ import annotations

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import RedirectResponse, Response

from app.services import study as services
from app.services.runtime import Runtime
from app.web.access import UNKNOWN_LINK
from app.web.guard import JoinLimit
from app.web.parts import SiteParts
from app.web.welcome import welcome_page
from study_core.study import Study

_COOKIE = "prefstudy-session"
_COOKIE_AGE_S = 30 * 24 * 3600


def join_routes(parts: SiteParts) -> APIRouter:
    """Returns the routes below `/join/{name}`."""
    router = APIRouter()
    limit = JoinLimit()

    def joinable(name: str) -> Study:
        if name != parts.study.name:
            raise HTTPException(404, UNKNOWN_LINK)
        return parts.study

    @router.get("/join/{name}")
    def welcome(request: Request, name: str) -> Response:
        study = joinable(name)
        token = request.cookies.get(_COOKIE)
        if token is not None and _is_unfinished(parts.runtime, token):
            return RedirectResponse(f"/s/{token}/", status_code=303)
        return welcome_page(request, study)

    @router.post("/join/{name}")
    def join(request: Request, name: str) -> Response:
        study = joinable(name)
        if not limit.allows(request.client.host if request.client else ""):
            raise HTTPException(429, ("Many people are joining just now", "Please try again in a minute."))
        token, _ = services.join(parts.runtime, study)
        response = RedirectResponse(f"/s/{token}/", status_code=303)
        is_secure = (parts.public_url or "").startswith("https://")
        # Whoever closes the tab and opens the join link again comes back to their own session.
        response.set_cookie(
            _COOKIE,
            token,
            _COOKIE_AGE_S,
            path=f"/join/{name}",
            secure=is_secure,
            httponly=True,
            samesite="lax",
        )
        return response

    return router


def _is_unfinished(runtime: Runtime, token: str) -> bool:
    record = services.find(runtime, token)
    return record is not None and services.screen(runtime, record.id).kind != "finished"
