"""The way to the stage through the whole site: who may open it, and what ends the connection."""

from __future__ import annotations

import contextlib

import httpx
import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from app.stage.proxy import SUBPROTOCOL
from tests.support.screens import screens
from tests.support.server import ServerProcess
from tests.web.conftest import join

CAMERA = msgspec.msgpack.encode(
    {
        "type": "ViewerCameraMessage",
        "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": [0.0, 0.0, 570.0],
        "fov": 0.003,
        "near": 1.0,
        "far": 600.0,
        "image_height": 400,
        "image_width": 800,
        "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 1.0, 0.0],
    }
)


def opened(
    server: ServerProcess, token: str, origin: str | None = "own", subprotocol: str = SUBPROTOCOL
) -> ClientConnection:
    """Opens a stage's websocket as a browser would."""
    said = server.url if origin == "own" else origin
    return connect(
        f"ws://127.0.0.1:{server.port}/s/{token}/stage",
        origin=None if said is None else Origin(said),
        subprotocols=[Subprotocol(subprotocol)],
        max_size=None,
        proxy=None,
    )


def closing_code(connection: ClientConnection) -> int:
    """Reads until the server closes the connection."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            connection.recv(timeout=60)
    assert connection.close_code is not None
    return connection.close_code


def test_our_own_page_gets_its_stage(server: ServerProcess, token: str) -> None:
    with opened(server, token) as connection:
        assert connection.subprotocol == SUBPROTOCOL
        connection.send(CAMERA)
        received = b""
        while b"glTF" not in received and len(received) < 10_000:
            message = connection.recv(timeout=60)
            assert isinstance(message, bytes)
            received += message
        assert len(received) > 1000


@pytest.mark.parametrize("origin", [None, "https://elsewhere.example", "null", "http://127.0.0.1:1"])
def test_a_foreign_page_gets_no_stage(server: ServerProcess, token: str, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused:
        opened(server, token, origin)
    assert refused.value.response.status_code == 403


def test_a_wrong_token_gets_no_stage_and_no_other_reason(server: ServerProcess) -> None:
    with pytest.raises(InvalidStatus) as refused:
        opened(server, "no-such-token")
    assert refused.value.response.status_code == 403


def test_another_version_of_the_viewer_gets_no_stage(server: ServerProcess, token: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        opened(server, token, subprotocol="viser-v0.0.0")
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize(
    ("message", "code"),
    [
        (msgspec.msgpack.encode({"type": "ShareUrlRequest"}), 1008),
        (msgspec.msgpack.encode({"type": "RunJavascriptMessage", "source": "1"}), 1008),
        (CAMERA + b"\x00", 1008),
        (b"", 1008),
        ("text", 1008),
        (b"x" * 70_000, 1009),
    ],
    ids=["share", "script", "more than a camera", "empty", "text", "too large"],
)
def test_what_a_stage_does_not_need_to_hear_ends_the_connection(
    server: ServerProcess, token: str, message: bytes | str, code: int
) -> None:
    with opened(server, token) as connection:
        connection.send(message)
        assert closing_code(connection) == code


@pytest.mark.parametrize(
    "query", ["websocket=wss://elsewhere.example", "playbackPath=/x", "a=1&WebSocket=&websocket="]
)
def test_the_viewer_cannot_be_sent_elsewhere(client: httpx.Client, token: str, query: str) -> None:
    assert client.get(f"/s/{token}/stage/?{query}").status_code == 400


def test_the_viewer_is_fetched_once(client: httpx.Client, token: str) -> None:
    first = client.get(f"/s/{token}/stage/")
    again = client.get(f"/s/{token}/stage/", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]
    assert client.get(f"/s/{token}/stage/", headers={"If-None-Match": '"another"'}).status_code == 200


def test_a_layout_is_noted_before_there_is_a_stage_and_nothing_else_is(
    server: ServerProcess, client: httpx.Client
) -> None:
    fresh = join(server)
    assert client.post(f"/s/{fresh}/stage", json={"action": "tall"}).status_code == 200
    assert client.post(f"/s/{fresh}/stage", json={"action": "pause"}).status_code == 409
    with opened(server, fresh) as connection:
        connection.send(CAMERA)
        connection.recv(timeout=60)
        for action in ("pause", "resume", "replay", "wide"):
            assert client.post(f"/s/{fresh}/stage", json={"action": action}).status_code == 200
        assert next(screens(client, f"/s/{fresh}/"))["stage_viewers"] == 1


@pytest.mark.parametrize("body", [{"action": "close"}, {}, {"action": "pause", "more": 1}, []])
def test_a_stage_does_only_what_a_participant_may_ask(client: httpx.Client, token: str, body: object) -> None:
    assert client.post(f"/s/{token}/stage", json=body).status_code == 422
