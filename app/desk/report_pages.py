"""The desk's page of a study's report, and of what a paper has to report."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, PlainTextResponse, RedirectResponse, Response

from app.desk.admission import Here
from app.desk.parts import DeskParts
from app.desk.view import desk_page
from app.services.monitor import study_summary
from app.store import Source, UnknownError


def report_routes(parts: DeskParts) -> APIRouter:
    """Returns the routes of reports."""
    router = APIRouter(prefix="/studies/{name}")
    runtime = parts.runtime

    @router.get("/report")
    def report(request: Request, name: str) -> Response:
        study = study_summary(runtime, parts.study, name)
        return desk_page(request, "report.html", {"study": study, "report": parts.reports.report(name)})

    @router.post("/report")
    def begin(here: Here, name: str) -> Response:
        study_summary(runtime, parts.study, name)
        parts.reports.begin(name)
        runtime.store.desk.record(here.name, "report_begun", name)
        return RedirectResponse(f"/desk/studies/{name}/report", status_code=303)

    @router.get("/report.html")
    def download(name: str) -> Response:
        made = parts.reports.report(name)
        if made.path is None:
            raise UnknownError(f"There is no report on '{name}' yet. Begin one first.")
        # Not shown here: its own styles and scripts would be against what the desk's pages allow.
        return FileResponse(made.path, filename=f"{name}-report.html")

    @router.get("/appendix.md")
    def appendix(here: Here, name: str) -> Response:
        # Loads matplotlib, which a server that starts does without.
        from app.report.appendix.document import appendix_sections, as_markdown

        study_summary(runtime, parts.study, name)
        sections = appendix_sections(runtime.store, name, Source.JOINED)
        runtime.store.desk.record(here.name, "appendix_made", name)
        headers = {"Content-Disposition": f'attachment; filename="{name}-appendix.md"'}
        return PlainTextResponse(
            as_markdown(f"Reporting appendix: {name}", sections), headers=headers, media_type="text/markdown"
        )

    return router
