"""What both the guard and the site show: a page for people, one JSON shape for programs, never an exception's text."""

from __future__ import annotations

from typing import Any

from fastapi import Request
from fastapi.responses import HTMLResponse, JSONResponse, Response
from fastapi.templating import Jinja2Templates
from jinja2 import Environment, FileSystemLoader, pass_context, select_autoescape
from jinja2.runtime import Context

from app.settings import STATIC
from app.web.languages import (
    choose_language,
    format_number,
    format_share,
    interface_languages,
    text_direction,
    translator,
)
from app.web.markdown import render_markdown


def page_language(request: Request) -> str:
    """Returns the language of the page that answers a request, as a BCP 47 tag.

    Whoever knows the person's session or study says so in `request.state.language`. Without it, for errors
    above all, it is what the address (`?lang=`) or the browser asks for, among the languages of the interface.
    """
    known: str | None = getattr(request.state, "language", None)
    return known or requested_language(request, interface_languages())


def requested_language(request: Request, available: tuple[str, ...]) -> str:
    """Returns which of these languages the address (`?lang=`) or else the browser asks for, or else the first."""
    return choose_language(
        request.query_params.get("lang"), request.headers.get("accept-language"), available
    )


def language_context(request: Request) -> dict[str, Any]:
    """Returns what every page needs of the language in which it answers a request."""
    language = page_language(request)
    return {"lang": language, "dir": text_direction(language), "translator": translator(language)}


# The translator is part of each page's context, so that pages in several languages can be made at once.
@pass_context
def _gettext(context: Context, message: str) -> str:
    translated: str = context["translator"].gettext(message)
    return translated


@pass_context
def _ngettext(context: Context, one: str, many: str, n: int) -> str:
    translated: str = context["translator"].ngettext(one, many, n)
    return translated


@pass_context
def _number(context: Context, value: float) -> str:
    return format_number(value, context["lang"])


@pass_context
def _percent(context: Context, share: float) -> str:
    return format_share(share, context["lang"])


def page_environment() -> Environment:
    """Returns the templates' environment: `_`, `ngettext`, `{% trans %}`, and our filters."""
    environment = Environment(
        loader=FileSystemLoader(STATIC / "templates"),
        autoescape=select_autoescape(),
        extensions=["jinja2.ext.i18n"],
    )
    environment.policies["ext.i18n.trimmed"] = True
    environment.install_gettext_callables(_gettext, _ngettext, newstyle=True)  # type: ignore[attr-defined]
    environment.filters |= {"number": _number, "percent": _percent, "markdown": render_markdown}
    return environment


templates = Jinja2Templates(env=page_environment(), context_processors=[language_context])


def error_json(status: int, code: str, message: str) -> JSONResponse:
    """Returns the one JSON shape of every error."""
    return JSONResponse({"error": {"code": code, "message": message}}, status_code=status)


def error_response(request: Request, status: int, code: str, title: str, text: str) -> Response:
    """Returns an error as a page if a person asked, else as JSON."""
    if "text/html" in request.headers.get("accept", ""):
        return message_page(request, title, text, status)
    return error_json(status, code, f"{title}. {text}")


def form_page(request: Request, template: str, context: dict[str, Any], status: int = 200) -> HTMLResponse:
    """Returns a page with a form."""
    response = templates.TemplateResponse(request, template, context, status)
    # Under `no-referrer`, browsers send the form with the origin "null", which the guard refuses.
    response.headers["Referrer-Policy"] = "same-origin"
    return response


def message_page(request: Request, title: str, text: str, status: int) -> HTMLResponse:
    """Returns a page that only says something.

    Args:
        request: Whom it answers; tells the language.
        title: In English, marked for the catalogues by `N_`.
        text: The same.
        status: HTTP's.
    """
    words = translator(page_language(request))
    context = {"title": words.gettext(title), "text": words.gettext(text)}
    return templates.TemplateResponse(request, "message.html", context, status)
