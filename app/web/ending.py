"""The last page of a session, however it ended: what is said, the completion code, and where it leads."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlsplit

from fastapi import Request
from fastapi.responses import Response

from app.services.joining import can_begin_again
from app.services.path import language_of
from app.services.runtime import LiveSession
from app.settings import STATIC
from app.web.pages import form_page, requested_language
from app.web.session_page import session_page
from study_core.path import Ending, EndingSection
from study_core.study import Study

_READY_TEXTS = STATIC / "texts"


def ending_page(request: Request, live: LiveSession) -> Response:
    """Returns the last page of a session that is over; it can be loaded as often as one likes."""
    assert live.state.ending is not None, "a session that goes on has no last page"
    said = _said(live.study, live.state.ending, language_of(live))
    return session_page(request, live, "ending.html", {**said, "can_begin_again": can_begin_again(live)})


def farewell_page(request: Request, study: Study) -> Response:
    """Returns the last page of a session of which nothing is left."""
    language = requested_language(request, study.languages)
    request.state.language = language
    context = {"title": study.title(language), **_said(study, Ending.DELETED, language)}
    return form_page(request, "ending.html", context)


def _said(study: Study, ending: Ending, language: str) -> dict[str, Any]:
    section = study.file.endings.get(ending, EndingSection())
    return {
        "ending": ending.value,
        "text": _text(study, ending, section.text, language),
        "code": section.code,
        "redirect": section.redirect,
        "redirect_host": urlsplit(section.redirect or "").hostname,
    }


def _text(study: Study, ending: Ending, name: str | None, language: str) -> str:
    """Returns the study's own text, or the ready one."""
    if name is None and ending is Ending.COMPLETED:
        name = "thanks"
    if name is not None:
        return study.text_named(name, language)
    ready = _READY_TEXTS / f"{ending}.{language}.md"
    return (ready if ready.exists() else _READY_TEXTS / f"{ending}.en.md").read_text(encoding="utf-8")
