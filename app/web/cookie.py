"""What a browser keeps, so that whoever opens a study's link there again comes back to their own session."""

from __future__ import annotations

import hashlib

from fastapi import Request
from fastapi.responses import Response

from app.store import ExternalPerson
from app.web.parts import SiteParts

_NAME = "prefstudy-session"
_AGE_S = 30 * 24 * 3600


def kept_token(request: Request, person: ExternalPerson | None) -> str | None:
    """Returns the token that this browser has kept for a person, if any."""
    return request.cookies.get(_name(person))


def keep_token(response: Response, parts: SiteParts, person: ExternalPerson | None, token: str) -> None:
    """Lets the browser keep a person's token, out of reach of scripts, for the study's join pages alone."""
    is_secure = (parts.public_url or "").startswith("https://")
    response.set_cookie(
        _name(person),
        token,
        _AGE_S,
        path=_path(parts),
        secure=is_secure,
        httponly=True,
        samesite="lax",
    )


def drop_token(response: Response, parts: SiteParts, person: ExternalPerson | None) -> None:
    """Lets the browser forget a person's token."""
    response.delete_cookie(_name(person), path=_path(parts), httponly=True, samesite="lax")


def _path(parts: SiteParts) -> str:
    return f"/join/{parts.study.name}"


def _name(person: ExternalPerson | None) -> str:
    """Returns a cookie's name: people who sit down at one browser, one after another, each have their own."""
    if person is None:
        return _NAME
    return f"{_NAME}-{hashlib.sha256(person.external_id.encode()).hexdigest()[:16]}"
