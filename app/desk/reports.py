"""Reports of a study: asked for, waited for, downloaded."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.desk.admission import Admitted, Here
from app.desk.login import only
from app.desk.parts import DeskParts
from app.desk.view import desk_page
from app.services.monitor import study_summary
from app.services.reports import ReportKind, ReportState, ReportStatus
from app.store import UnknownError
from app.web.forms import SentForm

PEOPLE = ("real", "rehearsed")
_MEDIA = {ReportKind.APPENDIX: "text/markdown", ReportKind.REPORT: "text/html"}
REPORT_FILES: dict[str, dict[str, str]] = {media: {} for media in _MEDIA.values()}
"""How a description says what a report's file is."""


class ReportWish(BaseModel):
    """What a report shall be about."""

    model_config = ConfigDict(extra="forbid")

    people: Literal["real", "rehearsed"] = Field("real", description="Whose sessions.")


def report_routes(parts: DeskParts) -> APIRouter:
    """Returns the desk's pages of reports."""
    router = APIRouter()

    @router.get("/studies/{name}/reports")
    def show(request: Request, name: str) -> Response:
        context = {
            "study": study_summary(parts.runtime, parts.study, name),
            "reports": {kind: parts.reports.state(name, kind) for kind in ReportKind},
        }
        return desk_page(request, "reports.html", context)

    @router.post("/studies/{name}/reports/{kind}")
    def begin(here: Here, name: str, kind: ReportKind, form: SentForm) -> Response:
        people = only(form, "people")
        begin_report(parts, here, name, kind, people if people in PEOPLE else PEOPLE[0])
        return RedirectResponse(f"/desk/studies/{name}/reports", 303)

    @router.get("/studies/{name}/reports/{kind}/file")
    def download(name: str, kind: ReportKind) -> Response:
        return report_file(parts, name, kind)

    return router


def begin_report(parts: DeskParts, here: Admitted, name: str, kind: ReportKind, people: str) -> ReportState:
    """Starts to write a report, and notes who has asked for it.

    Raises:
        UnknownError: There is no study of that name.
    """
    store = parts.runtime.store
    if name not in {record.name for record in store.studies()}:
        raise UnknownError(f"Expected the name of a study, got '{name}'. The desk lists them.")
    parts.reports.begin(name, kind, people)
    store.desk.record(here.name, "report_asked_for", name, {"kind": kind.value, "people": people})
    return parts.reports.state(name, kind)


def report_file(parts: DeskParts, name: str, kind: ReportKind) -> FileResponse:
    """Returns a report that is ready, as a file to be saved: the server's own pages have nothing to do with it.

    Raises:
        UnknownError: It isn't ready.
    """
    state = parts.reports.state(name, kind)
    if state.status is not ReportStatus.READY or state.path is None:
        raise UnknownError(f"Expected a {kind} of '{name}' that is ready, found none. Ask for it first.")
    return FileResponse(state.path, media_type=_MEDIA[kind], filename=f"{name}-{kind}{kind.suffix}")
