"""Lets in who may come in: whose request it is, and whether the route is for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from fastapi.responses import Response

from app.desk.access import ROLES, Caller, caller_of
from app.desk.parts import DeskParts
from app.errors import AppError
from app.store import Experimenter, Role

COOKIE = "prefstudy-desk"
LIVE = "prefstudy-live"
"""Header of requests by which a page keeps itself up to date: nobody has done anything."""

_PATHS = ("/desk", "/api")
_READS = ("GET", "HEAD", "OPTIONS")


class NotLoggedInError(AppError):
    """Nobody, or nobody any more.

    Attributes:
        has_expired: Whether there was a login.
    """

    def __init__(self, has_expired: bool) -> None:
        super().__init__(
            "Your login has ended. Log in again." if has_expired else "Log in, or send a token that holds."
        )
        self.has_expired = has_expired


class NotAllowedError(AppError):
    """Somebody whose role doesn't reach."""


class ForeignPageError(AppError):
    """A change that no page of ours has asked for."""


@dataclass(frozen=True)
class Admitted:
    """Who has come in.

    Attributes:
        experimenter: Who it is.
        is_program: Whether a program acts for them, by a token.
    """

    experimenter: Experimenter
    is_program: bool

    @property
    def name(self) -> str:
        """Returns their name."""
        return self.experimenter.name

    @property
    def is_owner(self) -> bool:
        """Returns whether they may do everything."""
        return self.experimenter.role is Role.OWNER

    @property
    def is_assistant(self) -> bool:
        """Returns whether they run the study, or more."""
        return self.experimenter.role.may_act_as(Role.ASSISTANT)


def admit(request: Request) -> None:
    """Lets a request in, or not; `Here` is who it is of.

    Raises:
        NotLoggedInError: It is nobody's.
        NotAllowedError: The route isn't for them.
        ForeignPageError: A browser doesn't say that a page of ours wants the change.
    """
    caller = caller_of(request)
    if caller is Caller.ANYONE:
        return
    admitted = _admitted(request)
    if not admitted.is_program:
        require_own_page(request)
    needed = ROLES[caller]
    if not admitted.experimenter.role.may_act_as(needed):
        raise NotAllowedError(
            f"This is for {caller.value}; you are {_WITH_ARTICLE[admitted.experimenter.role]}."
        )
    request.state.admitted = admitted


def require_own_page(request: Request) -> None:
    """Raises a ForeignPageError where a browser that would change something doesn't say that our page asks for it.

    The guard has refused every other origin, but a request without one could be anybody's who has made the browser send
    its cookie along.
    """
    if request.method in _READS or request.headers.get("origin") is not None:
        return
    if request.headers.get("sec-fetch-site") != "same-origin":
        raise ForeignPageError(
            "Expected the header Origin, which browsers send, or a token instead of a cookie."
        )


def keep_login(response: Response, parts: DeskParts, token: str) -> None:
    """Lets the browser keep a login's secret, out of reach of scripts and of other sites."""
    for path in _PATHS:
        response.set_cookie(
            COOKIE, token, path=path, secure=parts.is_encrypted, httponly=True, samesite="strict"
        )


def drop_login(response: Response) -> None:
    """Lets the browser forget it."""
    for path in _PATHS:
        response.delete_cookie(COOKIE, path=path, httponly=True, samesite="strict")


def address_of(request: Request) -> str:
    """Returns where a request comes from."""
    return request.client.host if request.client else ""


def _admitted(request: Request) -> Admitted:
    parts: DeskParts = request.app.state.parts
    scheme, _, secret = request.headers.get("authorization", "").partition(" ")
    if scheme:
        program = parts.accounts.program(secret.strip()) if scheme.lower() == "bearer" else None
        if program is None:
            raise NotLoggedInError(has_expired=False)
        return Admitted(program, is_program=True)
    kept = request.cookies.get(COOKIE)
    is_active = LIVE not in request.headers
    experimenter = None if kept is None else parts.accounts.experimenter(kept, is_active)
    if experimenter is None:
        raise NotLoggedInError(has_expired=kept is not None)
    return Admitted(experimenter, is_program=False)


_WITH_ARTICLE = {Role.VIEWER: "a viewer", Role.ASSISTANT: "an assistant", Role.OWNER: "an owner"}


def _here(request: Request) -> Admitted:
    admitted: Admitted = request.state.admitted
    return admitted


Here = Annotated[Admitted, Depends(_here)]
"""Whose request it is; `admit` has let them in."""
