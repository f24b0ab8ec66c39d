"""The desk's pages of studies: all of them, one as it goes on, and the links that lead to it."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.desk.admission import Here
from app.desk.conditions import ConditionLooks, blinded
from app.desk.exports import Wished, archive
from app.desk.links import TooManyLinksError, open_link, personal_links, prolific_link
from app.desk.login import only
from app.desk.monitor_page import COLUMNS, PEOPLE, SHOWN, listed, spreads
from app.desk.parts import DeskParts
from app.desk.view import desk_page
from app.services.export.errors import ExportError
from app.services.links import IncompleteLinkError
from app.services.monitor import overview, study_summaries, study_summary
from app.web.forms import SentForm


def study_routes(parts: DeskParts, looks: ConditionLooks) -> APIRouter:
    """Returns the routes of studies.

    Args:
        parts: What the desk is made of.
        looks: Notes who looks at conditions.
    """
    router = APIRouter()

    @router.get("/")
    def studies(request: Request) -> Response:
        return desk_page(request, "studies.html", {"studies": study_summaries(parts.runtime, parts.study)})

    @router.get("/studies/{name}")
    def monitor(request: Request, here: Here, name: str) -> Response:
        asked = request.query_params
        kind = asked.get("people", "")
        found = overview(parts.runtime, parts.study, name, PEOPLE.get(kind, PEOPLE["joined"]))
        sees_conditions = "conditions" in asked
        if sees_conditions:
            looks.look(here, name)
        find, order = asked.get("find", "").strip(), asked.get("sort", "number")
        context = {
            "study": found.summary,
            "people": found.people,
            "rows": listed(found.people, asked.get("show", ""), find if here.is_assistant else "", order),
            "arms": found.arms if sees_conditions else blinded(found.arms),
            "sees_conditions": sees_conditions,
            "has_conditions": len(found.arms) > 1,
            "troubles": found.troubles,
            "spreads": spreads(found.people),
            "columns": COLUMNS,
            "shown": {key: label for key, (label, _) in SHOWN.items()},
            "kinds": list(PEOPLE),
            "order": order,
        }
        return desk_page(request, "study.html", context)

    def links_page(
        request: Request, name: str, ids: str, links: dict[str, str], problem: str = ""
    ) -> Response:
        base = parts.base_url(request)
        context = {
            "study": study_summary(parts.runtime, parts.study, name),
            "ids": ids,
            "links": links,
            "problem": problem,
            "open_link": open_link(name, base),
            "prolific_link": prolific_link(name, base),
        }
        return desk_page(request, "links.html", context, 422 if problem else 200)

    @router.get("/studies/{name}/links")
    def show_links(request: Request, name: str) -> Response:
        return links_page(request, name, "", {})

    @router.post("/studies/{name}/links")
    def make_links(request: Request, here: Here, name: str, form: SentForm) -> Response:
        ids, store = only(form, "ids"), parts.runtime.store
        try:
            links = personal_links(store, name, ids.splitlines(), parts.base_url(request))
        except (IncompleteLinkError, TooManyLinksError) as error:
            return links_page(request, name, ids, {}, str(error))
        page = links_page(request, name, ids, links)
        store.desk.record(here.name, "links_made", name, {"links": len(links)})
        return page

    @router.get("/studies/{name}/export")
    def ask_for_export(request: Request, name: str) -> Response:
        study = study_summary(parts.runtime, parts.study, name)
        return desk_page(request, "export.html", {"study": study, "problem": ""})

    @router.get("/studies/{name}/export.zip")
    def export(request: Request, here: Here, name: str, wish: Wished) -> Response:
        try:
            return archive(parts, here, name, wish)
        except ExportError as error:
            study = study_summary(parts.runtime, parts.study, name)
            return desk_page(request, "export.html", {"study": study, "problem": str(error)}, 422)

    return router
