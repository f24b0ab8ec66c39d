"""The page that says what a study is about and begins it."""

from __future__ import annotations

from fastapi import Request
from fastapi.responses import Response

from app.web.pages import templates
from study_core.study import Study

_SECONDS_PER_QUERY = 14


def welcome_page(request: Request, study: Study) -> Response:
    """Returns the welcome page; its form posts to the page's own address."""
    n_queries, language = study.n_queries, study.languages[0]
    context = {
        "title": study.title(language),
        "about": study.text_named("welcome", language).strip(),
        "n_questions": n_queries,
        "minutes": max(1, round(n_queries * _SECONDS_PER_QUERY / 60)),
    }
    response = templates.TemplateResponse(request, "welcome.html", context)
    # Under `no-referrer`, browsers send the form with the origin "null", which the guard refuses.
    response.headers["Referrer-Policy"] = "same-origin"
    return response
