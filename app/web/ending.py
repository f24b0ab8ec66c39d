"""The last page: how it ended, the code that says so to a recruitment service, and the way back there."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlsplit

from fastapi import Request
from fastapi.responses import Response

from app.services.path import language_of
from app.services.runtime import LiveSession
from app.web.pages import form_page, page_language
from app.web.session_page import session_page
from study_core.path import Ending, EndingSection
from study_core.study import Study


def ending_page(request: Request, live: LiveSession) -> Response:
    """Returns the last page of a session that is over."""
    ending = live.state.ending
    assert ending is not None, "a session that goes on has no last page"
    return session_page(request, live, "ending.html", _context(live.study, ending, language_of(live)))


def farewell_page(request: Request, study: Study, ending: Ending) -> Response:
    """Returns the last page where there is no session any more; `request.state.language` says its language."""
    language = page_language(request)
    context = {"title": study.title(language), **_context(study, ending, language)}
    return form_page(request, "ending.html", context)


def _context(study: Study, ending: Ending, language: str) -> dict[str, Any]:
    section = study.file.endings.get(ending, EndingSection())
    name = section.text or ("thanks" if ending is Ending.COMPLETED else None)
    return {
        "ending": ending.value,
        "text": None if name is None else study.text_named(name, language),
        "code": section.code,
        "redirect": section.redirect,
        "redirect_host": urlsplit(section.redirect or "").hostname,
    }
