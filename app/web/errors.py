"""Every error is a page for people and one JSON shape for programs; neither shows an exception's text."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException as StarletteHTTPException

from app.services import study as services
from app.store import SessionDeletedError
from app.web.guard import protect
from app.web.pages import error_json, error_response

_UNKNOWN_PAGE = ("There is nothing here", "Check that the whole address was copied.")


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
        title, text = "This session was deleted", "Nothing of it is kept. You can close this page."
        return error_response(request, 410, "deleted", title, text)

    @site.exception_handler(Exception)
    async def failure(request: Request, error: Exception) -> Response:
        text = "Your answers so far are saved. Please try again in a moment."
        response = error_response(request, 500, "internal", "Something went wrong on our side", text)
        # This runs outside the guard, and outside everything else.
        protect(request.url.path, response.headers)
        return response
