"""What every request must pass: the same origin for anything that writes, small bodies, few tries, safe headers."""

from __future__ import annotations

import time
from collections import OrderedDict, deque

from fastapi import Request
from fastapi.responses import Response
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.origin import is_same_origin
from app.web.languages import N_
from app.web.pages import error_response

_LARGEST_BODY = 64 * 1024
# Room for a page of long answers in any script, or a thousand ids: a form takes up to 12 bytes for a character.
_LARGEST_FORM = 512 * 1024
_LONG = ("/step", "/links")
_ADDRESSES_REMEMBERED = 10_000

_FOREIGN = (N_("This came from another page"), N_("Open the study’s own link and try again there."))
_NO_LENGTH = (
    N_("This can’t be taken"),
    N_("Your browser didn’t say how much it sends. Please try another one."),
)
_TOO_LARGE = (
    N_("This is too much at once"),
    N_("Go back and shorten what you have typed. Nothing else was lost."),
)

_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src 'self' data:; frame-src 'self'; frame-ancestors 'self'; base-uri 'none'; "
        "form-action 'self'; object-src 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
}


def protect(path: str, headers: MutableHeaders) -> None:
    """Adds the headers that keep our pages safe, where a response to that path has none of its own."""
    for name, value in _HEADERS.items():
        headers.setdefault(name, value)
    if not path.startswith("/static/"):
        headers.setdefault("Cache-Control", "no-store")


class Guard:
    """Middleware of the whole site: refuses what can't come from our own pages, and protects every response."""

    def __init__(self, app: ASGIApp, public_url: str | None) -> None:
        self._app = app
        self._public_url = public_url

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles one connection; a websocket is checked where it is accepted."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                protect(scope["path"], MutableHeaders(scope=message))
            await send(message)

        answer = self._refusal(Request(scope)) or self._app
        await answer(scope, receive, send_protected)

    def _refusal(self, request: Request) -> Response | None:
        if request.method in ("GET", "HEAD", "OPTIONS"):
            return None
        origin = request.headers.get("origin")
        if origin is not None and not is_same_origin(origin, request.headers.get("host"), self._public_url):
            return error_response(request, 403, "foreign-origin", *_FOREIGN)
        # Without either header there is no body; with the other one, nobody knows how much is to come.
        length = request.headers.get("content-length", "" if "transfer-encoding" in request.headers else "0")
        if not length.isdigit():
            return error_response(request, 411, "length-required", *_NO_LENGTH)
        largest = _LARGEST_FORM if request.url.path.endswith(_LONG) else _LARGEST_BODY
        if int(length) > largest:
            return error_response(request, 413, "too-large", *_TOO_LARGE)
        return None


class RateLimit:
    """At most so many tries a minute from one address."""

    def __init__(self, per_minute: int) -> None:
        self._per_minute = per_minute
        self._tries: OrderedDict[str, deque[float]] = OrderedDict()

    def allows(self, address: str) -> bool:
        """Returns whether one more try is allowed now, and counts it if so."""
        now = time.monotonic()
        recent = self._tries.setdefault(address, deque())
        self._tries.move_to_end(address)
        while len(self._tries) > _ADDRESSES_REMEMBERED:
            self._tries.popitem(last=False)
        while recent and now - recent[0] > 60.0:
            recent.popleft()
        if len(recent) >= self._per_minute:
            return False
        recent.append(now)
        return True
