"""What a participant's pages around the queries send: steps of the path, and the language to go on in."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.services import path
from app.web.access import ThisSession
from app.web.forms import SentForm, number_in
from app.web.parts import SiteParts
from app.web.step_page import step_page

STEP, TRIES, LANGUAGE = "_step", "_tries", "language"
"""Fields of ours; no item of a questionnaire can be called as the first two."""


def step_routes(parts: SiteParts) -> APIRouter:
    """Returns the routes below `/s/{token}/` by which a person goes along the path."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.post("/step")
    def take(request: Request, token: str, session: ThisSession, form: SentForm) -> Response:
        step, n_tries = number_in(form, STEP), number_in(form, TRIES)
        if step is None or n_tries is None:
            return _home(token)
        receipt = path.take_step(runtime, session.id, step, form, n_tries)
        if not receipt.problems:
            return _home(token)
        return step_page(request, runtime, session.id, receipt.screen.step, form, receipt.problems)

    @router.get("/step")
    def stray(token: str, session: ThisSession) -> Response:
        """Leads back whoever loads the address of a form that was sent."""
        return _home(token)

    @router.post("/language")
    def choose_language(token: str, session: ThisSession, form: SentForm) -> Response:
        path.choose_language(runtime, session.id, "".join(form.get(LANGUAGE, [])[:1]))
        return _home(token)

    return router


def _home(token: str) -> Response:
    return RedirectResponse(f"/s/{token}/", status_code=303)
