"""What passes between a browser and a stage, over real sockets on this machine."""

from __future__ import annotations

import asyncio
import struct
import threading
import time
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
import uvicorn
import zstandard
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Origin, Subprotocol

from app.origin import is_same_origin
from app.stage import proxy
from app.stage.clip import N_FLAGS, build_clip
from app.stage.framing import Layout
from app.stage.keeper import StageKeeper
from app.stage.stage import Picture

CAMERA: dict[str, Any] = {
    "type": "ViewerCameraMessage",
    "wxyz": [1, 0, 0, 0.5],
    "position": [0, 0, 570.25],
    "fov": 0.003,
    "near": 1,
    "far": 600,
    "image_height": 400,
    "image_width": 800,
    "look_at": [0, 0, 0],
    "up_direction": [0, 1, 0],
}


class Site:
    """The smallest web application that relays, in a thread."""

    def __init__(self, picture: Picture) -> None:
        self.keeper = StageKeeper(lambda _: picture, idle_s=5)
        app = Starlette(routes=[WebSocketRoute("/s/token/stage", self._stage)])
        config = uvicorn.Config(app, host="127.0.0.1", port=0, log_level="error", ws="websockets-sansio")
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, daemon=True)
        self._thread.start()
        while not self._server.started:
            time.sleep(0.01)
        self.port = self._server.servers[0].sockets[0].getsockname()[1]

    async def _stage(self, browser: WebSocket) -> None:
        headers = browser.headers
        if not is_same_origin(headers.get("origin"), headers.get("host"), None):
            await browser.close(1008)
            return
        async with self.keeper.visit("ann") as stage:
            await proxy.relay(browser, stage.port)

    def open(self, origin: str | None = "ours", subprotocol: str = proxy.SUBPROTOCOL) -> Connection:
        address = f"127.0.0.1:{self.port}"
        return connect(
            f"ws://{address}/s/token/stage",
            origin=Origin(f"http://{address}") if origin == "ours" else Origin(origin) if origin else None,
            subprotocols=[Subprotocol(subprotocol)],
            compression=None,
            proxy=None,
            max_size=None,
        )

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join(timeout=10)
        self.keeper.close()


@pytest.fixture
def site(picture: Picture) -> Iterator[Site]:
    site = Site(picture)
    yield site
    site.close()


def closing_code(socket: Connection) -> int:
    """Reads until the other side closes."""
    try:
        while True:
            socket.recv(timeout=5)
    except ConnectionClosed as closed:
        return closed.rcvd.code if closed.rcvd else 0


def send(socket: Connection, message: object) -> None:
    socket.send(msgspec.msgpack.encode(message))


def test_a_browser_gets_the_scene_and_may_tell_its_camera(site: Site) -> None:
    with site.open() as socket:
        assert socket.subprotocol == proxy.SUBPROTOCOL
        assert unpacked(socket.recv(timeout=5))
        send(socket, CAMERA)
        stage = site.keeper.find("ann")
        assert stage is not None
        deadline = time.monotonic() + 5
        while not stage._server.get_clients():
            assert time.monotonic() < deadline, "viser never saw the camera"
            time.sleep(0.01)
        [client] = stage._server.get_clients().values()
        assert tuple(client.camera.position) == (0, 0, 570.25)


def unpacked(message: str | bytes) -> bytes:
    """The compressed part of one of viser's messages."""
    assert isinstance(message, bytes)
    size, compressed_size = struct.unpack_from("<QQ", message)
    return zstandard.decompress(message[16 : 16 + compressed_size], max_output_size=size)


def test_the_clip_reaches_the_browser_unchanged(site: Site, picture: Picture) -> None:
    clips = [build_clip(picture.a, picture.b, Layout.WIDE, flag=flag) for flag in range(N_FLAGS)]
    with site.open() as socket:
        deadline = time.monotonic() + 5
        received = b""
        while not any(clip in received for clip in clips):
            assert time.monotonic() < deadline
            received = unpacked(socket.recv(timeout=5))


@pytest.mark.parametrize("origin", [None, "null", "https://evil.example", "http://127.0.0.1:1", "garbage"])
def test_a_foreign_origin_is_refused_before_anything_starts(site: Site, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused:
        site.open(origin)
    assert refused.value.response.status_code == 403
    assert len(site.keeper) == 0


def test_another_version_of_viser_is_refused(site: Site) -> None:
    with pytest.raises(InvalidStatus):
        site.open(subprotocol="viser-v0.0.1")


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {}},
        {"type": "FileTransferStartUpload"},
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {**CAMERA, "extra": 1},
        {**CAMERA, "fov": "wide"},
        {"no": "type"},
        [1, 2],
        None,
    ],
    ids=str,
)
def test_any_other_message_ends_the_connection(site: Site, message: object) -> None:
    with site.open() as socket:
        send(socket, message)
        assert closing_code(socket) == 1008


@pytest.mark.parametrize("garbage", [b"", b"\xc1", b"\x81\xa4type", b"\x93" * 60_000, "text"], ids=range(5))
def test_an_unreadable_message_ends_the_connection(site: Site, garbage: bytes | str) -> None:
    with site.open() as socket:
        socket.send(garbage)
        assert closing_code(socket) == 1008


def test_a_message_that_is_too_large_ends_the_connection(site: Site) -> None:
    with site.open() as socket:
        socket.send(bytes(proxy.MAX_MESSAGE_BYTES + 1))
        assert closing_code(socket) == 1009


def test_a_closed_stage_ends_the_connection(site: Site) -> None:
    with site.open() as socket:
        socket.recv(timeout=5)
        stage = site.keeper.find("ann")
        assert stage is not None
        stage.close()
        assert closing_code(socket) == 1001


def test_a_browser_that_goes_away_is_counted_out(site: Site) -> None:
    with site.open():
        assert site.keeper.n_viewers("ann") == 1
    deadline = time.monotonic() + 5
    while site.keeper.n_viewers("ann"):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_what_a_browser_may_send_is_written_anew() -> None:
    message = msgspec.msgpack.encode(CAMERA)
    assert msgspec.msgpack.decode(proxy.checked(message)) == CAMERA


def test_a_stage_that_does_not_answer_refuses_the_browser() -> None:
    class Browser:
        def __init__(self) -> None:
            self.scope = {"subprotocols": [proxy.SUBPROTOCOL]}
            self.code = 0

        async def close(self, code: int) -> None:
            self.code = code

    browser = Browser()
    asyncio.run(proxy.relay(browser, 1))  # type: ignore[arg-type]
    assert browser.code == 1001


@pytest.mark.parametrize(
    ("origin", "host", "public_url", "is_same"),
    [
        ("http://127.0.0.1:8000", "127.0.0.1:8000", None, True),
        ("https://study.example", "study.example", None, True),
        ("https://STUDY.example:443", "study.example", None, True),
        ("https://study.example", "inner:8000", "https://study.example/base", True),
        ("http://study.example", "study.example", "https://study.example", False),
        ("https://study.example.evil.example", "study.example", None, False),
        ("https://evil.example", "study.example", None, False),
        ("https://study.example:444", "study.example", None, False),
        ("null", "study.example", None, False),
        (None, "study.example", None, False),
        ("", None, None, False),
        ("https://", None, None, False),
        ("https://study.example:x", "study.example", None, False),
    ],
)
def test_only_our_own_pages_have_the_same_origin(
    origin: str | None, host: str | None, public_url: str | None, is_same: bool
) -> None:
    assert is_same_origin(origin, host, public_url) is is_same


@pytest.mark.parametrize(
    ("query", "is_forbidden"),
    [
        ("", False),
        ("darkMode", False),
        ("websocket=ws://evil.example", True),
        ("a=1&playbackPath=x", True),
        ("websocket", True),
        ("%77ebsocket=ws://evil.example", True),
    ],
)
def test_query_keys_that_bring_in_another_scene_are_recognised(query: str, is_forbidden: bool) -> None:
    assert proxy.has_forbidden_query(query) is is_forbidden


def test_the_client_page_is_visers_own_with_a_strict_policy() -> None:
    page, headers = proxy.client_page()
    assert b"[data-floating-window]" in page
    assert page.rstrip().endswith(b"</html>")
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert "'unsafe-eval'" not in policy
    assert "frame-ancestors 'self'" in policy
    assert headers["Referrer-Policy"] == "no-referrer"
