"""The guarded way from a browser to a stage.

viser has no notion of users: whoever reaches its port may move anything, and may ask it to open a public
tunnel. So its port is open to this machine only, and what passes between it and a browser passes here: the
client page with a strict policy, and the websocket with checks on everything that the browser sends.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Coroutine, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib.resources import files
from urllib.parse import parse_qsl

import msgspec
import viser
import websockets
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from app.stage.stage import StageError

SUBPROTOCOL = f"viser-v{viser.__version__}"
"""What viser's client and server say to each other first; they must match exactly."""

MAX_MESSAGE_BYTES = 64 * 1024

_FORBIDDEN_KEYS = frozenset({"websocket", "playbackPath"})

_POLICY_VIOLATION = 1008
_TOO_BIG = 1009
_GONE = 1001

# The panel with the server's address, the share button, notifications, the logo and the orbit gizmo: none of
# it is for participants. The page's own background shows for the instant before the first frame.
_STYLE = """
<style>
html, body, #root { background: #86a86b !important; overflow: hidden; }
#root > div > div > div, #root canvas { background: transparent !important; }
[data-floating-window], [data-dock-root] > :not(:has(canvas)), .mantine-Notifications-root,
.mantine-Notification-root, .mantine-Modal-root, .mantine-Paper-root, .mantine-Drawer-root,
.mantine-ActionIcon-root, .mantine-Affix-root, a[title="About Viser"] { display: none !important; }
</style>
"""

_POLICY = "; ".join(
    (
        "default-src 'none'",
        # The client is one file that unpacks itself with WebAssembly into an inline script; `unsafe-eval` stays
        # out, so that no message can make the page run code.
        "script-src 'unsafe-inline' 'wasm-unsafe-eval'",
        "style-src 'unsafe-inline'",
        "worker-src blob:",
        "img-src data: blob:",
        "font-src data:",
        # Not `data:`: the client would spend its first second on an environment map that clips don't use.
        "connect-src 'self'",
        "frame-ancestors 'self'",
        "base-uri 'none'",
        "form-action 'none'",
    )
)


class _Camera(msgspec.Struct, tag_field="type", tag="ViewerCameraMessage", forbid_unknown_fields=True):
    """The one message that a scene without controls sends: where the camera is.

    viser counts a client as connected when it has sent its first, so it can't be left out.
    """

    wxyz: tuple[float, float, float, float]
    position: tuple[float, float, float]
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: tuple[float, float, float]
    up_direction: tuple[float, float, float]


_decoder = msgspec.msgpack.Decoder(_Camera)
_encoder = msgspec.msgpack.Encoder()


class ForbiddenMessageError(StageError):
    """A browser sent what it may not send.

    Attributes:
        code: The websocket code to close with.
    """

    def __init__(self, code: int, what: str) -> None:
        super().__init__(f"{what} The connection is closed.")
        self.code = code


@lru_cache(maxsize=1)
def client_page() -> tuple[bytes, Mapping[str, str]]:
    """Returns viser's own client, from the installed package, made fit for participants.

    Returns:
        The HTML page and its response headers. Serve it at `.../stage/`: it opens the websocket at its own
        address without the final slash.
    """
    html = files("viser").joinpath("client", "build", "index.html").read_text(encoding="utf-8")
    before, head_end, after = html.rpartition("</head>")
    page = before + _STYLE + head_end + after
    headers = {
        "Content-Type": "text/html; charset=utf-8",
        "Content-Security-Policy": _POLICY,
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "SAMEORIGIN",
        "Cache-Control": "private, no-cache",
        "ETag": f'"{hashlib.sha256(page.encode()).hexdigest()[:32]}"',
    }
    return page.encode(), headers


def has_forbidden_query(query: str) -> bool:
    """Whether a page's query string would make the client take its scene from somewhere else.

    Args:
        query: Without the question mark.
    """
    return any(key in _FORBIDDEN_KEYS for key, _ in parse_qsl(query, keep_blank_values=True))


async def relay(browser: WebSocket, stage_port: int) -> None:
    """Accepts a browser's websocket and joins it to a stage until either side ends.

    Check the origin and the session first. A message that is too large, unreadable or not allowed ends the
    connection; whatever the server sends passes unchanged, no faster than the browser takes it.

    Args:
        browser: Not yet accepted.
        stage_port: Port of the stage's viser server on this machine.
    """
    if SUBPROTOCOL not in browser.scope.get("subprotocols", ()):
        await browser.close(_POLICY_VIOLATION)
        return
    address = f"ws://127.0.0.1:{stage_port}"
    try:
        stage = await connect(
            address,
            subprotocols=[Subprotocol(SUBPROTOCOL)],
            compression=None,
            max_size=None,
            max_queue=4,
            proxy=None,
        )
    except (OSError, websockets.exceptions.WebSocketException):
        await browser.close(_GONE)
        return
    async with stage:
        await browser.accept(subprotocol=SUBPROTOCOL)
        code = await _first_to_end(_upwards(browser, stage), _downwards(stage, browser))
    if code is not None:
        await _close_quietly(browser, code)


async def _first_to_end(*ways: Coroutine[None, None, int | None]) -> int | None:
    """Runs both directions until one ends; returns the code to close the browser with, if it is still there."""
    tasks = [asyncio.create_task(way) for way in ways]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return next(iter(done)).result()


async def _upwards(browser: WebSocket, stage: ClientConnection) -> int | None:
    """Passes on what the browser may say."""
    try:
        while True:
            message = await browser.receive()
            if message["type"] == "websocket.disconnect":
                return None
            await stage.send(checked(message.get("bytes")))
    except ForbiddenMessageError as error:
        return error.code
    except (WebSocketDisconnect, RuntimeError):
        return None
    except websockets.exceptions.ConnectionClosed:
        return _GONE


async def _downwards(stage: ClientConnection, browser: WebSocket) -> int | None:
    """Passes everything from the stage to the browser; waits for the browser to take each message."""
    try:
        async for message in stage:
            await browser.send_bytes(message if isinstance(message, bytes) else message.encode())
    except (WebSocketDisconnect, RuntimeError):
        return None
    except websockets.exceptions.ConnectionClosed:
        pass
    return _GONE


async def _close_quietly(browser: WebSocket, code: int) -> None:
    with suppress(WebSocketDisconnect, RuntimeError):
        await browser.close(code)


def checked(message: bytes | None) -> bytes:
    """Checks one message from a browser.

    Args:
        message: The binary message, or none if it was text.

    Returns:
        The message written anew from what was understood, so that nothing else travels with it.

    Raises:
        ForbiddenMessageError: It is too large, unreadable or not of an allowed type.
    """
    if message is None:
        raise ForbiddenMessageError(_POLICY_VIOLATION, "Expected a binary message, got text.")
    if len(message) > MAX_MESSAGE_BYTES:
        raise ForbiddenMessageError(
            _TOO_BIG, f"Expected at most {MAX_MESSAGE_BYTES} bytes, got {len(message)}."
        )
    try:
        return _encoder.encode(_decoder.decode(message))
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ForbiddenMessageError(
            _POLICY_VIOLATION, "Expected a camera message, got something else."
        ) from error
