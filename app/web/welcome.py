"""The page that says what a study is about and begins it."""

from __future__ import annotations

from fastapi import Request
from fastapi.responses import Response

from app.services.duration import expected_minutes
from app.web.languages import language_name
from app.web.pages import form_page, requested_language
from study_core.study import Study


def welcome_page(
    request: Request, study: Study, ticket: str | None = None, earlier: str | None = None
) -> Response:
    """Returns the welcome page; its form posts to the page's own address.

    Args:
        request: Whom it answers.
        study: The study to begin.
        ticket: What the form brings along, so that sending it twice begins one session.
        earlier: Address of a session that somebody has finished in this browser.
    """
    n_queries, language = study.n_queries, requested_language(request, study.languages)
    request.state.language = language
    context = {
        "title": study.title(language),
        "about": study.text_named("welcome", language).strip(),
        "n_questions": n_queries,
        "minutes": expected_minutes(study),
        "languages": {tag: language_name(tag) for tag in study.languages},
        "ticket": ticket,
        "earlier": earlier,
    }
    return form_page(request, "welcome.html", context)
