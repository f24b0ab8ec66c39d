"""What all pages of a session have in common: its language, how far it is, and the ways out."""

from __future__ import annotations

from typing import Any

from fastapi import Request
from fastapi.responses import Response

from app.services.path import language_of
from app.services.runtime import LiveSession
from app.web.languages import language_name
from app.web.pages import form_page


def session_page(
    request: Request, live: LiveSession, template: str, context: dict[str, Any], status: int = 200
) -> Response:
    """Returns a page of a session.

    Args:
        request: Whom it answers.
        live: The session.
        template: Name of a template; most extend `reading.html`.
        context: What else the template needs.
        status: HTTP's.
    """
    study, state, language = live.study, live.state, language_of(live)
    request.state.language = language
    is_on_the_way = state.ending is None and state.participant is not None
    common = {
        "title": study.title(language),
        "step": state.step + 1 if is_on_the_way else None,
        "n_steps": len(study.file.path),
        "can_leave": is_on_the_way,
        "languages": {tag: language_name(tag) for tag in study.languages},
    }
    return form_page(request, template, common | context, status)
