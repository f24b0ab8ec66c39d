"""What the API says when something is wrong: one JSON shape, with the status that its description names."""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException as StarletteHTTPException

from app.desk.admission import ForeignPageError, NotAllowedError, NotLoggedInError
from app.errors import AppError
from app.services.desk_people import NotReopenedError
from app.store import (
    ExperimenterKnownError,
    LastOwnerError,
    ReviewChangedError,
    SessionDeletedError,
    UnknownError,
)
from app.web.guard import protect
from app.web.pages import error_json

# The first that an error is one of.
_STATUSES: tuple[tuple[type[AppError], int, str], ...] = (
    (NotLoggedInError, 401, "not-logged-in"),
    (NotAllowedError, 403, "not-allowed"),
    (ForeignPageError, 403, "foreign-origin"),
    (SessionDeletedError, 410, "deleted"),
    (UnknownError, 404, "unknown"),
    (ReviewChangedError, 409, "changed-meanwhile"),
    (NotReopenedError, 409, "not-reopened"),
    (ExperimenterKnownError, 409, "name-taken"),
    (LastOwnerError, 409, "last-owner"),
    (AppError, 422, "refused"),
)


def add_api_errors(api: FastAPI) -> None:
    """Adds what the API answers when something is wrong."""

    @api.exception_handler(AppError)
    async def refused(request: Request, error: AppError) -> JSONResponse:
        status, code = next((status, code) for kind, status, code in _STATUSES if isinstance(error, kind))
        response = error_json(status, code, str(error))
        if status == 401:
            response.headers["WWW-Authenticate"] = "Bearer"
        return response

    @api.exception_handler(StarletteHTTPException)
    async def http_error(request: Request, error: StarletteHTTPException) -> JSONResponse:
        response = error_json(error.status_code, f"http-{error.status_code}", str(error.detail))
        response.headers.update(error.headers or {})
        return response

    @api.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        problem = error.errors()[0]
        where = ".".join(str(part) for part in problem["loc"] if part != "body")
        return error_json(422, "invalid-request", f"{where or 'body'}: {problem['msg']}.")

    @api.exception_handler(Exception)
    async def failure(request: Request, error: Exception) -> JSONResponse:
        response = error_json(
            500, "internal", "Something went wrong on our side. The server’s log says more."
        )
        protect(request.url.path, response.headers)
        return response
