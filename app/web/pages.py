"""What both the guard and the site show: a page for people, one JSON shape for programs, never an exception's text."""

from __future__ import annotations

from fastapi import Request
from fastapi.responses import HTMLResponse, JSONResponse, Response
from fastapi.templating import Jinja2Templates

from app.settings import STATIC

templates = Jinja2Templates(STATIC / "templates")
# What marks a string for people; until there is a catalogue, each says itself.
templates.env.globals["_"] = str


def error_json(status: int, code: str, message: str) -> JSONResponse:
    """Returns the one JSON shape of every error."""
    return JSONResponse({"error": {"code": code, "message": message}}, status_code=status)


def error_response(request: Request, status: int, code: str, title: str, text: str) -> Response:
    """Returns an error as a page if a person asked, else as JSON."""
    if "text/html" in request.headers.get("accept", ""):
        return message_page(request, title, text, status)
    return error_json(status, code, f"{title}. {text}")


def message_page(request: Request, title: str, text: str, status: int) -> HTMLResponse:
    """Returns a page that only says something."""
    return templates.TemplateResponse(request, "message.html", {"title": title, "text": text}, status)
