"""Every error is a page for people and one JSON shape for programs; neither shows an exception's text."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException as StarletteHTTPException

from app.services import study as services
from app.services.links import IncompleteLinkError, WrongSignatureError
from app.store import SessionDeletedError
from app.web.guard import protect
from app.web.languages import N_
from app.web.pages import error_json, error_response

_UNKNOWN_PAGE = (N_("There is nothing here"), N_("Check that the whole address was copied."))
_INCOMPLETE_LINK = (
    N_("This link is not complete"),
    N_(
        "It should say who you are, and doesn’t. Go back to where you found it and open it from there, or ask the "
        "people who run the study for a new one. Nothing was begun."
    ),
)
_WRONG_SIGNATURE = (
    N_("This personal link is not right"),
    N_(
        "Check that the whole link was copied, to its very last letter, or ask the person who sent it to you for a new "
        "one. Nothing was lost."
    ),
)
_DELETED = (N_("This session was deleted"), N_("Nothing of it is kept. You can close this page."))
_FAILURE = (
    N_("Something went wrong on our side"),
    N_("Your answers so far are saved. Please try again in a moment."),
)


def add_error_pages(site: FastAPI) -> None:
    """Adds what the site answers when something is wrong."""

    @site.exception_handler(StarletteHTTPException)
    async def http_error(request: Request, error: StarletteHTTPException) -> Response:
        detail: Any = error.detail
        title, text = _UNKNOWN_PAGE if isinstance(detail, str) else detail
        return error_response(request, error.status_code, f"http-{error.status_code}", title, text)

    @site.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        problem = error.errors()[0]
        where = ".".join(str(part) for part in problem["loc"] if part != "body")
        return error_json(422, "invalid-request", f"{where or 'body'}: {problem['msg']}.")

    @site.exception_handler(services.InvalidAnswerError)
    async def invalid_answer(request: Request, error: services.InvalidAnswerError) -> Response:
        return error_json(422, "invalid-answer", str(error))

    @site.exception_handler(SessionDeletedError)
    async def deleted(request: Request, error: SessionDeletedError) -> Response:
        return error_response(request, 410, "deleted", *_DELETED)

    @site.exception_handler(IncompleteLinkError)
    async def incomplete_link(request: Request, error: IncompleteLinkError) -> Response:
        return error_response(request, 400, "incomplete-link", *_INCOMPLETE_LINK)

    @site.exception_handler(WrongSignatureError)
    async def wrong_signature(request: Request, error: WrongSignatureError) -> Response:
        return error_response(request, 403, "wrong-signature", *_WRONG_SIGNATURE)

    @site.exception_handler(Exception)
    async def failure(request: Request, error: Exception) -> Response:
        response = error_response(request, 500, "internal", *_FAILURE)
        # This runs outside the guard, and outside everything else.
        protect(request.url.path, response.headers)
        return response
