"""The ways out of a session, and to another device: stopping, deleting, beginning again, the personal link."""

from __future__ import annotations

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import RedirectResponse, Response

from app.services import leaving, path
from app.services.joining import Door, code_of
from app.services.links import farewell_query
from app.web.access import ThisSession
from app.web.cookie import drop_token, keep_token
from app.web.forms import SentForm
from app.web.joining import refusal
from app.web.languages import N_
from app.web.parts import SiteParts
from app.web.session_page import session_page
from study_core.path import Ending

KEEP, DELETE = "keep", "delete"

_UNDECIDED = (
    N_("Nothing was changed"),
    N_("Go back and choose whether your answers are to be kept or deleted."),
)


def leaving_routes(parts: SiteParts, door: Door) -> APIRouter:
    """Returns the routes below `/s/{token}/` that lead out of a session."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.get("/device")
    def device(request: Request, token: str, session: ThisSession) -> Response:
        base = parts.public_url or str(request.base_url)
        context = {
            "link": f"{base.rstrip('/')}/s/{token}/",
            "code": code_of(runtime, token),
            "code_page": f"{base.rstrip('/')}/join/{parts.study.name}/resume",
            "is_beginning": "begin" in request.query_params,
        }
        return session_page(request, runtime.live(session.id), "device.html", context)

    @router.get("/leave")
    def leave(request: Request, session: ThisSession) -> Response:
        live, what = runtime.live(session.id), request.query_params.get("what")
        is_over = live.state.ending is not None
        # Whoever is through has nothing to stop, but may still take everything back.
        chosen = DELETE if is_over else what if what in (KEEP, DELETE) else None
        return session_page(request, live, "leave.html", {"chosen": chosen, "is_over": is_over})

    @router.post("/stop")
    def stop(token: str, session: ThisSession, form: SentForm) -> Response:
        what = form.get("what")
        if what == [KEEP]:
            path.end(runtime, session.id, Ending.STOPPED)
            return RedirectResponse(f"/s/{token}/", status_code=303)
        if what != [DELETE]:
            raise HTTPException(422, _UNDECIDED)
        live, person = runtime.live(session.id), door.person_of(token)
        leaving.delete(runtime, session.id)
        query = farewell_query(runtime.store, live.study.hash, path.language_of(live))
        response = RedirectResponse(f"/join/{parts.study.name}/deleted?{query}", status_code=303)
        drop_token(response, parts, person)
        return response

    @router.post("/again")
    def begin_again(request: Request, token: str, session: ThisSession) -> Response:
        found = door.begin_again(token)
        if found.token is None:
            return refusal(request, parts.study, found.arrival)
        response = RedirectResponse(f"/s/{found.token}/", status_code=303)
        keep_token(response, parts, door.person_of(found.token), found.token)
        return response

    return router
