"""The pages of a participant's path around the queries: steps, breaks, endings; and what their forms do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any
from urllib.parse import urlsplit

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, ConfigDict

from app.services import path
from app.services.path import Form, language_of
from app.services.result import result_of
from app.services.runtime import LiveSession, Runtime
from app.web.access import ThisSession
from app.web.duration import expected_minutes
from app.web.forms import SentForm, number_in
from app.web.languages import format_minutes, format_number
from app.web.parts import SiteParts
from app.web.pictures import strip_of
from app.web.session_page import session_page
from study_core.path import (
    DebriefStep,
    Ending,
    EndingSection,
    InstructionsStep,
    PracticeStep,
    QuestionnaireStep,
    Step,
    questionnaire_of,
    text_of,
)
from study_core.questionnaire import Problem
from study_core.section import Words, words_in
from study_core.study import Study

STEP, TRIES = "_step", "_tries"
"""Fields that say which page was sent; an item of a questionnaire can't be called so."""


class QueryBody(BaseModel):
    """Names a query."""

    model_config = ConfigDict(extra="forbid", strict=True)

    query_index: int


def step_routes(parts: SiteParts) -> APIRouter:
    """Returns the routes below `/s/{token}/` by which a person goes along the path."""
    router = APIRouter(prefix="/s/{token}")
    runtime = parts.runtime

    @router.post("/step")
    def take(request: Request, token: str, session: ThisSession, form: SentForm) -> Response:
        step, n_tries = number_in(form, STEP), number_in(form, TRIES)
        if step is None or n_tries is None:
            return _home(token)
        receipt = path.take_step(runtime, session.id, step, form, n_tries)
        if not receipt.problems:
            return _home(token)
        live = runtime.live(session.id)
        return step_page(request, runtime, live, receipt.screen.step, form, receipt.problems)

    @router.get("/step")
    def stray(token: str, session: ThisSession) -> Response:
        """Leads back whoever reloads a page that was sent."""
        return _home(token)

    @router.post("/language")
    def choose_language(token: str, session: ThisSession, form: SentForm) -> Response:
        path.choose_language(runtime, session.id, "".join(form.get("language", [])[:1]))
        return _home(token)

    @router.post("/break")
    def end_break(session: ThisSession, body: QueryBody) -> dict[str, Any]:
        return {"screen": asdict(path.end_break(runtime, session.id, body.query_index))}

    @router.post("/take-back")
    def take_back(session: ThisSession, body: QueryBody) -> dict[str, Any]:
        return {"screen": asdict(path.take_back(runtime, session.id, body.query_index))}

    return router


def _home(token: str) -> Response:
    return RedirectResponse(f"/s/{token}/", status_code=303)


def step_page(
    request: Request,
    runtime: Runtime,
    live: LiveSession,
    step: int,
    typed: Form | None = None,
    problems: Mapping[str, Problem] | None = None,
) -> Response:
    """Returns the page of a step.

    Args:
        request: Whom it answers.
        runtime: The services' resources.
        live: The session that is at it.
        step: Its place in the path.
        typed: What was filled in before.
        problems: By item, what has to be mended in it.
    """
    study, language = live.study, language_of(live)
    current = study.file.path[step]
    context = {
        "step_index": step,
        "n_tries": live.state.n_tries,
        "text": _text(study, current, language),
        "values": _values(study, language),
        "typed": typed or {},
        "problems": problems or {},
        **_more(runtime, live, step),
    }
    return session_page(request, live, f"{current.step}.html", context, 422 if problems else 200)


def _more(runtime: Runtime, live: LiveSession, step: int) -> dict[str, Any]:
    """Returns what the page of one kind of step needs besides."""
    study, language = live.study, language_of(live)
    current, *following = study.file.path[step:]
    if isinstance(current, (PracticeStep, QuestionnaireStep)):
        return _questions(study, current, language)
    if isinstance(current, InstructionsStep):
        is_practice_next = bool(following) and isinstance(following[0], PracticeStep)
        outlook = _text(study, following[0], language) if is_practice_next else None
        return {"has_example": current.example, "outlook": outlook}
    if isinstance(current, DebriefStep) and current.results:
        return _result(runtime, live)
    return {}


def _questions(study: Study, current: PracticeStep | QuestionnaireStep, language: str) -> dict[str, Any]:
    def said(words: Words) -> str:
        return words_in(words, language)

    name = questionnaire_of(current)
    items = () if name is None else study.file.questionnaire[name]
    explained = [step.text for step in study.file.path if isinstance(step, InstructionsStep)]
    again = study.text_named(explained[-1], language) if explained else None
    return {"items": items, "said": said, "instructions": again}


def _result(runtime: Runtime, live: LiveSession) -> dict[str, Any]:
    found = result_of(runtime, live)
    if found is None:
        return {"result": None}
    drives = [found.drive] if found.others is None else [found.drive, found.others.drive]
    return {"result": found, "strips": strip_of(live.study.domain, drives)}


def _text(study: Study, step: Step, language: str) -> str | None:
    name = text_of(step)
    return None if name is None else study.text_named(name, language)


def _values(study: Study, language: str) -> dict[str, str]:
    """Returns what a text may name in braces."""
    return {
        "questions": format_number(study.n_queries, language),
        "duration": format_minutes(expected_minutes(study), language),
    }


def ending_page(request: Request, live: LiveSession) -> Response:
    """Returns the last page of a session that is over."""
    study, language, ending = live.study, language_of(live), live.state.ending
    assert ending is not None, "a session that goes on has no last page"
    section = study.file.endings.get(ending, EndingSection())
    name = section.text or ("thanks" if ending is Ending.COMPLETED else None)
    context = {
        "ending": ending.value,
        "text": None if name is None else study.text_named(name, language),
        "code": section.code,
        "redirect": section.redirect,
        "redirect_host": urlsplit(section.redirect or "").hostname,
    }
    return session_page(request, live, "ending.html", context)
