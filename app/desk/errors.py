"""What the desk's pages say when something is wrong; nothing that somebody has typed is lost."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import PlainTextResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException as StarletteHTTPException

from app.desk.admission import LIVE, ForeignPageError, NotAllowedError, NotLoggedInError
from app.desk.login import Interrupted, login_page
from app.desk.view import desk_page
from app.errors import AppError
from app.store import LastOwnerError, SessionDeletedError, UnknownError
from app.web.forms import fields_of
from app.web.guard import protect

_NOTHING_HERE = ("There is nothing here", "Check the address, or begin at the studies.")
_FAILURE = ("Something went wrong on our side", "Please try again in a moment. The server’s log says more.")
_DELETED = ("This person was deleted", "Nothing of them is kept, except in the audit that they were.")


def add_desk_errors(desk: FastAPI) -> None:
    """Adds what the desk answers when something is wrong."""

    @desk.exception_handler(NotLoggedInError)
    async def not_logged_in(request: Request, error: NotLoggedInError) -> Response:
        if LIVE in request.headers:
            return PlainTextResponse(str(error), 401)
        if request.method == "POST":
            return login_page(request, 401, interrupted=await _interrupted(request))
        if request.app.state.parts.accounts.needs_owner:
            return RedirectResponse("/desk/setup", status_code=303)
        back = request.url.path + (f"?{request.url.query}" if request.url.query else "")
        ended = "&ended=1" if error.has_expired else ""
        return RedirectResponse(f"/desk/login?next={quote(back, safe='')}{ended}", status_code=303)

    @desk.exception_handler(NotAllowedError)
    async def not_allowed(request: Request, error: NotAllowedError) -> Response:
        return _message(request, 403, "Not for you", f"{error} An owner can change that.")

    @desk.exception_handler(ForeignPageError)
    async def foreign(request: Request, error: ForeignPageError) -> Response:
        return _message(
            request, 403, "This came from another page", "Open the desk itself and try again there."
        )

    @desk.exception_handler(SessionDeletedError)
    async def deleted(request: Request, error: SessionDeletedError) -> Response:
        return _message(request, 410, *_DELETED)

    @desk.exception_handler(UnknownError)
    async def unknown(request: Request, error: UnknownError) -> Response:
        return _message(request, 404, *_NOTHING_HERE)

    @desk.exception_handler(LastOwnerError)
    async def last_owner(request: Request, error: LastOwnerError) -> Response:
        return _message(request, 409, "Somebody must be left", str(error))

    @desk.exception_handler(AppError)
    async def refused(request: Request, error: AppError) -> Response:
        return _message(request, 422, "That can’t be done", str(error))

    @desk.exception_handler(StarletteHTTPException)
    async def http_error(request: Request, error: StarletteHTTPException) -> Response:
        detail: Any = error.detail
        return _message(request, error.status_code, *(_NOTHING_HERE if isinstance(detail, str) else detail))

    @desk.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        return _message(
            request, 422, "That can’t be done", "Go back, and choose among what is offered there."
        )

    @desk.exception_handler(Exception)
    async def failure(request: Request, error: Exception) -> Response:
        response = _message(request, 500, *_FAILURE)
        # This runs outside the guard.
        protect(request.url.path, response.headers)
        return response


async def _interrupted(request: Request) -> Interrupted | None:
    try:
        return Interrupted.of(request, await fields_of(request))
    except StarletteHTTPException:
        # No form of ours: there is nothing to keep.
        return None


def _message(request: Request, status: int, title: str, text: str) -> Response:
    return desk_page(request, "message.html", {"title": title, "text": text}, status)
