"""The door of the desk: the first owner, logging in and out, one's own password."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.desk.admission import COOKIE, Here, address_of, drop_login, keep_login, require_own_page
from app.desk.parts import DeskParts
from app.desk.view import desk_page
from app.services.desk_accounts import (
    ImpossibleNameError,
    TooManyTriesError,
    WrongCodeError,
    WrongPasswordError,
)
from app.services.passwords import SHORTEST, WeakPasswordError
from app.store import ExperimenterKnownError
from app.web.forms import Fields, SentForm

_HOME = "/desk/"
_KEPT, _KEPT_PATH = "kept.", "kept-path"
_NEVER_KEPT = "password"
_Refused = (ImpossibleNameError, TooManyTriesError, WrongCodeError, WrongPasswordError, WeakPasswordError)


@dataclass(frozen=True)
class Interrupted:
    """A form that came when its sender's login had ended.

    Attributes:
        path: Where it was sent to.
        fields: What was typed; no passwords.
    """

    path: str
    fields: Mapping[str, list[str]]

    @classmethod
    def of(cls, request: Request, form: Fields) -> Interrupted:
        """Returns the form that a request brings."""
        kept = {name: values for name, values in form.items() if _NEVER_KEPT not in name}
        return cls(request.url.path, kept)

    @classmethod
    def kept_in(cls, form: Fields) -> Interrupted | None:
        """Returns the form that a login page has brought along, if it has."""
        path = _place(only(form, _KEPT_PATH), "")
        if not path:
            return None
        fields = {name.removeprefix(_KEPT): values for name, values in form.items() if name.startswith(_KEPT)}
        return cls(path, fields)


def login_page(
    request: Request,
    status: int = 200,
    name: str = "",
    problem: str = "",
    following: str = _HOME,
    interrupted: Interrupted | None = None,
    has_ended: bool = False,
) -> Response:
    """Returns the page on which one logs in.

    Args:
        request: Whom it answers.
        status: HTTP's.
        name: What was typed as a name.
        problem: Why the last try was refused.
        following: Where it leads.
        interrupted: A form to send again afterwards.
        has_ended: Whether there was a login before.
    """
    context = {
        "name": name,
        "problem": problem,
        "following": following,
        "interrupted": interrupted,
        "has_ended": has_ended or interrupted is not None,
    }
    return desk_page(request, "login.html", context, status)


def login_routes(parts: DeskParts) -> APIRouter:
    """Returns the routes by which one comes in and goes."""
    router = APIRouter()
    accounts = parts.accounts

    @router.get("/setup")
    def ask_for_owner(request: Request) -> Response:
        if not accounts.needs_owner:
            return RedirectResponse("/desk/login", status_code=303)
        return _setup_page(request)

    @router.post("/setup")
    def set_up(request: Request, form: SentForm) -> Response:
        require_own_page(request)
        name = only(form, "name")
        try:
            token = accounts.set_up(only(form, "code"), name, only(form, "password"), address_of(request))
        except ExperimenterKnownError:
            return RedirectResponse("/desk/login", status_code=303)
        except _Refused as error:
            return _setup_page(request, _status(error), name, only(form, "code"), str(error))
        return _logged_in(parts, token, _HOME)

    @router.get("/login")
    def ask_to_log_in(request: Request) -> Response:
        if accounts.needs_owner:
            return RedirectResponse("/desk/setup", status_code=303)
        following = _place(request.query_params.get("next", ""), _HOME)
        return login_page(request, following=following, has_ended="ended" in request.query_params)

    @router.post("/login")
    def log_in(request: Request, form: SentForm) -> Response:
        require_own_page(request)
        name, interrupted = only(form, "name"), Interrupted.kept_in(form)
        following = _place(only(form, "next"), _HOME)
        try:
            token = accounts.log_in(name, only(form, "password"), address_of(request))
        except (TooManyTriesError, WrongPasswordError) as error:
            return login_page(request, _status(error), name, str(error), following, interrupted)
        if interrupted is None:
            return _logged_in(parts, token, following)
        response = desk_page(request, "resend.html", {"interrupted": interrupted})
        keep_login(response, parts, token)
        return response

    @router.post("/logout")
    def log_out(request: Request) -> Response:
        require_own_page(request)
        kept = request.cookies.get(COOKIE)
        if kept is not None:
            accounts.log_out(kept)
        response = RedirectResponse("/desk/login", status_code=303)
        drop_login(response)
        return response

    @router.get("/me")
    def me(request: Request, here: Here) -> Response:
        return _me_page(request)

    @router.post("/me")
    def change_password(request: Request, here: Here, form: SentForm) -> Response:
        old, new = only(form, "old-password"), only(form, "new-password")
        try:
            token = accounts.change_password(here.name, old, new, address_of(request))
        except _Refused as error:
            return _me_page(request, _status(error), problem=str(error))
        response = _me_page(request, has_changed=True)
        keep_login(response, parts, token)
        return response

    return router


def only(form: Fields, name: str) -> str:
    """Returns the one value of a field; empty where there is none."""
    return "".join(form.get(name, [])[:1])


def _setup_page(
    request: Request, status: int = 200, name: str = "", code: str = "", problem: str = ""
) -> Response:
    context = {"name": name, "code": code, "problem": problem, "shortest": SHORTEST}
    return desk_page(request, "setup.html", context, status)


def _me_page(request: Request, status: int = 200, problem: str = "", has_changed: bool = False) -> Response:
    context = {"problem": problem, "has_changed": has_changed, "shortest": SHORTEST}
    return desk_page(request, "me.html", context, status)


def _logged_in(parts: DeskParts, token: str, following: str) -> Response:
    response = RedirectResponse(following, status_code=303)
    keep_login(response, parts, token)
    return response


def _place(path: str, otherwise: str) -> str:
    """Returns a place of the desk that a page names; anything else leads elsewhere, and is not followed."""
    is_ours = path.startswith(_HOME) and "\\" not in path and path.isprintable()
    return path if is_ours and "//" not in path else otherwise


def _status(error: Exception) -> int:
    if isinstance(error, TooManyTriesError):
        return 429
    return 403 if isinstance(error, WrongCodeError | WrongPasswordError) else 422
