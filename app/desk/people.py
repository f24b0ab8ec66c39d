"""The desk's page of one person, and what is decided there."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.desk.admission import Here
from app.desk.conditions import ConditionLooks
from app.desk.login import only
from app.desk.parts import DeskParts
from app.desk.person_page import courses, posterior_picture
from app.desk.view import desk_page
from app.errors import AppError
from app.services import desk_people
from app.services.history import history_of
from app.services.links import personal_link
from app.services.monitor import Person, person_of
from app.store import Review, ReviewChangedError, Verdict
from app.web.forms import Fields, SentForm, number_in


class ImpossibleVerdictError(AppError):
    """A verdict that there isn't."""


def people_routes(parts: DeskParts, looks: ConditionLooks) -> APIRouter:
    """Returns the routes of people.

    Args:
        parts: What the desk is made of.
        looks: Notes who looks at conditions.
    """
    router = APIRouter(prefix="/people/{session_id}")
    runtime = parts.runtime

    def person_page(
        request: Request, here: Here, session_id: str, status: int = 200, **told: Any
    ) -> Response:
        person, history = person_of(runtime, session_id), history_of(runtime, session_id)
        sees_condition = "conditions" in request.query_params
        if sees_condition:
            looks.look(here, session_id)
        context = {
            "person": person,
            "history": history,
            "study_name": runtime.store.study_name(person.line.session.study_hash),
            "posterior": posterior_picture(history),
            "courses": courses(history),
            "sees_condition": sees_condition,
            "can_reopen": person.is_over and desk_people.can_reopen(runtime, session_id),
            "link": _link(request, parts, here, person),
            "review": person.line.review,
            "typed": None,
            "verdicts": list(Verdict),
        }
        return desk_page(request, "person.html", context | told, status)

    @router.get("")
    def person(request: Request, here: Here, session_id: str) -> Response:
        return person_page(request, here, session_id)

    @router.post("/review")
    def review(request: Request, here: Here, session_id: str, form: SentForm) -> Response:
        wanted = _review(form)
        try:
            desk_people.review(runtime, here.name, session_id, wanted)
        except ReviewChangedError:
            return person_page(request, here, session_id, 409, typed=wanted, has_changed=True)
        except desk_people.ImpossibleReviewError as error:
            return person_page(request, here, session_id, 422, typed=wanted, problem=str(error))
        return _to(f"/desk/people/{session_id}#decision")

    @router.post("/reopen")
    def reopen(here: Here, session_id: str) -> Response:
        desk_people.reopen(runtime, here.name, session_id)
        return _to(f"/desk/people/{session_id}")

    @router.post("/delete")
    def delete(request: Request, here: Here, session_id: str, form: SentForm) -> Response:
        found = person_of(runtime, session_id)
        if only(form, "confirmation").strip() != f"delete {found.number}":
            return person_page(request, here, session_id, 422, is_unconfirmed=True)
        study_name = runtime.store.study_name(found.line.session.study_hash)
        desk_people.delete(runtime, here.name, session_id)
        return _to(f"/desk/studies/{study_name}?people={found.line.session.source.value}")

    return router


def _link(request: Request, parts: DeskParts, here: Here, person: Person) -> str | None:
    """Returns the person's own link, for whoever may know their external id, if they have one."""
    external = person.line.external
    if external is None or not here.is_assistant:
        return None
    return personal_link(
        parts.runtime.store, external.study_name, external.external_id, parts.base_url(request)
    )


def _review(form: Fields) -> Review:
    verdict = only(form, "verdict")
    try:
        wanted = Verdict(verdict) if verdict else None
    except ValueError as error:
        raise ImpossibleVerdictError("Expected a verdict: rejected, excluded, or none.") from error
    return Review(wanted, only(form, "reason").strip(), only(form, "note"), number_in(form, "revision") or 0)


def _to(path: str) -> Response:
    return RedirectResponse(path, status_code=303)
