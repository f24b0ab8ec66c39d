"""The pages of a path's steps: what each kind says, asks and shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastapi import Request
from fastapi.responses import Response

from app.services.duration import expected_minutes
from app.services.path import Form, language_of
from app.services.result import result_of
from app.services.runtime import LiveSession, Runtime
from app.web.languages import format_minutes, format_number
from app.web.pictures import pictures_of
from app.web.questionnaires import fields
from app.web.session_page import session_page
from study_core.path import DebriefStep, InstructionsStep, PracticeStep, Step, questionnaire_of, text_of
from study_core.questionnaire import Problem
from study_core.study import Study

_NOTHING: Mapping[str, Any] = {}


def step_page(
    request: Request,
    runtime: Runtime,
    session_id: str,
    step: int,
    filled_in: Form = _NOTHING,
    problems: Mapping[str, Problem] = _NOTHING,
) -> Response:
    """Returns the page of a step, whose template is called as its kind is.

    Args:
        request: Whom it answers.
        runtime: The services' resources.
        session_id: Whose step.
        step: Its place in the path.
        filled_in: What the person has sent, if some of it has to be mended.
        problems: By item, what has to be mended.
    """
    live = runtime.live(session_id)
    study, language = live.study, language_of(live)
    current, *coming = study.file.path[step:]
    asked = study.file.questionnaire.get(questionnaire_of(current) or "", ())
    context = {
        "step_index": step,
        "n_tries": live.state.n_tries,
        "text": _text(study, current, language),
        "values": _values(study, language),
        "fields": fields(asked, language, filled_in, problems),
    }
    if isinstance(current, InstructionsStep):
        context |= {"has_example": current.example, "outlook": _outlook(study, coming, language)}
    if isinstance(current, PracticeStep):
        context["instructions"] = _instructions(study, step, language)
    if isinstance(current, DebriefStep) and current.results:
        context |= _result(runtime, live)
    return session_page(request, live, f"{current.step}.html", context, 422 if problems else 200)


def _text(study: Study, step: Step, language: str) -> str | None:
    name = text_of(step)
    return None if name is None else study.text_named(name, language)


def _values(study: Study, language: str) -> dict[str, str]:
    """Returns what a text may name in braces."""
    return {
        "questions": format_number(study.n_queries, language),
        "duration": format_minutes(expected_minutes(study), language),
    }


def _outlook(study: Study, coming: list[Step], language: str) -> str | None:
    """Returns what is said of the practice, which begins at once after the instructions."""
    is_practice_next = bool(coming) and isinstance(coming[0], PracticeStep)
    return _text(study, coming[0], language) if is_practice_next else None


def _instructions(study: Study, step: int, language: str) -> str | None:
    """Returns the instructions that came before a step, to be read again."""
    earlier = [one for one in study.file.path[:step] if isinstance(one, InstructionsStep)]
    return _text(study, earlier[-1], language) if earlier else None


def _result(runtime: Runtime, live: LiveSession) -> dict[str, Any]:
    result = result_of(runtime, live)
    if result is None:
        return {"result": None}
    drives = [taste.drive for taste in (result.own, result.others) if taste is not None]
    return {"result": result, "pictures": pictures_of(live.study.domain, drives)}
