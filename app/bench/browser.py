"""One participant's browser, as far as the server can tell: page, stage, screens, answers.

It does what `static/js/trial.js` and viser's own client do, in the same order, and keeps the time; it only never
says that a clip has loaded.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

import httpx
import msgspec
import zstandard
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin, Subprotocol

from app.bench.report import BenchError
from app.stage.framing import CAMERA
from app.stage.proxy import SUBPROTOCOL

# The layout of viser's messages: two lengths of 8 bytes, then the compressed part of the second length.
_HEADER_BYTES = 16
_TURNED_DOWN = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SentAnswer:
    """An answer that the server has acknowledged.

    Attributes:
        token: Whose.
        query_index: The query it answers.
        choice: As the page sends it, such as `first`.
        sent_at: When the request was sent, in seconds of `time.perf_counter`.
        replied_at: When the reply had come.
        next_screen: Kind of the screen in the reply.
    """

    token: str
    query_index: int
    choice: str
    sent_at: float
    replied_at: float
    next_screen: str


@dataclass(frozen=True)
class ShownClip:
    """A clip that has arrived on a person's websocket, to the last byte.

    Attributes:
        token: Whose.
        digest: SHA-256 of the clip.
        at: When, in seconds of `time.perf_counter`.
    """

    token: str
    digest: str
    at: float


@dataclass
class Diary:
    """What happened to everybody.

    Attributes:
        answers: Every answer that was acknowledged.
        clips: Every clip that arrived.
        n_resent: Requests that a connection took with it which the server was just closing.
    """

    answers: list[SentAnswer] = field(default_factory=list)
    clips: list[ShownClip] = field(default_factory=list)
    n_resent: int = 0


class Browser:
    """A browser with one session's page open."""

    def __init__(self, http: httpx.AsyncClient, token: str, diary: Diary) -> None:
        """Opens nothing yet; see `open_page`.

        Args:
            http: Shared by everybody; its base URL is the server's, its headers hold the origin.
            token: The session's secret.
            diary: Where to write.
        """
        self._http, self._token, self._diary = http, token, diary
        self._screen: dict[str, Any] = {"kind": "preparing", "position": -1}
        self._has_changed = asyncio.Event()
        self._has_picture = asyncio.Event()

    @property
    def is_finished(self) -> bool:
        """Whether the session is at its end."""
        return bool(self._screen["kind"] == "finished")

    async def question(self) -> int | None:
        """Waits for a question and returns its query index, or None at the end of the session."""
        while self._screen["kind"] == "preparing":
            self._has_changed.clear()
            await self._has_changed.wait()
        index: int | None = self._screen["query_index"]
        return index

    async def picture(self) -> None:
        """Waits until something is on the stage."""
        await self._has_picture.wait()

    async def answer(self, query_index: int, choice: str, response_time_ms: int) -> None:
        """Sends an answer and writes down what became of it."""
        body = {
            "query_index": query_index,
            "choice": choice,
            "response_time_ms": response_time_ms,
            "client": {
                "means": "keyboard",
                "layout": "wide",
                "replays": 0,
                "pauses": 0,
                "hidden": 0,
                "viewport": [1280, 720],
                "device_pixel_ratio": 1,
            },
        }
        sent_at = time.perf_counter()
        reply = (await self._ask("POST", "answer", body)).json()
        replied_at = time.perf_counter()
        # The second: the answer had been taken, and its reply was lost with the connection.
        if reply["outcome"] not in ("taken", "already-taken"):
            raise BenchError(f"Expected the answer to be taken, got '{reply['outcome']}'.")
        screen = reply["screen"]
        self._diary.answers.append(
            SentAnswer(self._token, query_index, choice, sent_at, replied_at, screen["kind"])
        )
        self._apply(screen)

    async def load(self) -> None:
        """Fetches the page, says how the sides are arranged, and fetches the stage's page."""
        await self._ask("GET", "")
        await self._ask("POST", "stage", {"action": "wide"})
        await self._ask("GET", "stage/")

    async def follow(self) -> None:
        """Takes in the screens that the server sends, until the session is finished."""
        async with self._http.stream("GET", f"/s/{self._token}/screens") as reply:
            if not reply.is_success:
                raise BenchError(f"Expected GET screens to be served, got {reply.status_code}.")
            async for line in reply.aiter_lines():
                if line:
                    self._apply(json.loads(line.removeprefix("data: ")))
        if not self.is_finished:
            raise BenchError("Expected screens until the session is finished, but the server ended them.")

    async def watch(self) -> None:
        """Keeps the stage's websocket open and writes down every clip."""
        base = self._http.base_url
        async with connect(
            f"ws://{base.host}:{base.port}/s/{self._token}/stage",
            subprotocols=[Subprotocol(SUBPROTOCOL)],
            origin=Origin(f"http://{base.host}:{base.port}"),
            compression=None,
            max_size=None,
            proxy=None,
        ) as stage:
            await stage.send(camera_message())
            await self._receive(stage)

    async def _ask(self, method: str, address: str, body: dict[str, Any] | None = None) -> httpx.Response:
        """Sends a request; like a browser, once more if a kept connection was closed under it."""
        url = f"/s/{self._token}/{address}"
        try:
            reply = await self._http.request(method, url, json=body)
        except (httpx.ReadError, httpx.RemoteProtocolError):
            self._diary.n_resent += 1
            reply = await self._http.request(method, url, json=body)
        if not reply.is_success:
            raise BenchError(
                f"Expected {method} {address} to be served, got {reply.status_code}: {reply.text[:200]}."
            )
        return reply

    async def _receive(self, stage: ClientConnection) -> None:
        try:
            async for message in stage:
                arrived_at = time.perf_counter()
                for clip in clips_in(message if isinstance(message, bytes) else message.encode()):
                    digest = hashlib.sha256(clip).hexdigest()
                    self._diary.clips.append(ShownClip(self._token, digest, arrived_at))
                    self._has_picture.set()
        except ConnectionClosed as error:
            raise BenchError("Expected the stage to stay open, but the server closed it.") from error

    def _apply(self, screen: dict[str, Any]) -> None:
        if screen["position"] >= self._screen["position"]:
            self._screen = screen
            self._has_changed.set()


@asynccontextmanager
async def open_page(http: httpx.AsyncClient, token: str, diary: Diary) -> AsyncIterator[Browser]:
    """Opens a session's page with its stage; leaves both with the block.

    Raises:
        BenchError: The server refuses, or closes the stage.
    """
    browser = Browser(http, token, diary)
    await browser.load()
    # A task that fails ends the block: whoever waits for a question that can't come must not wait for ever.
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(browser.follow()), group.create_task(browser.watch())]
        yield browser
        for task in tasks:
            task.cancel()


async def join(http: httpx.AsyncClient, study_name: str) -> str:
    """Joins the study as a new person and returns the session's secret token."""
    reply = await http.post(f"/join/{study_name}")
    if reply.status_code != 303:
        raise BenchError(f"Expected to be let in, got status {reply.status_code}.")
    # /s/TOKEN/, and more for who keeps no cookies: they are shown first how to come back.
    return reply.headers["location"].split("/")[2]


def clips_in(message: bytes) -> list[bytes]:
    """Returns the clips (GLB files) that one of viser's messages brings."""
    end = _HEADER_BYTES + int.from_bytes(message[8:_HEADER_BYTES], "little")
    packed = zstandard.decompress(message[_HEADER_BYTES:end])
    window = msgspec.msgpack.decode(packed)
    return [each["props"]["glb_data"] for each in window["messages"] if each["type"] == "GlbMessage"]


def camera_message() -> bytes:
    """Returns what viser's client says first; without it, viser doesn't count it as connected."""
    return msgspec.msgpack.encode(
        {
            "type": "ViewerCameraMessage",
            "wxyz": _TURNED_DOWN,
            "position": CAMERA.position,
            "fov": CAMERA.fov_rad,
            "near": CAMERA.near,
            "far": CAMERA.far,
            "image_height": 640,
            "image_width": 1184,
            "look_at": CAMERA.look_at,
            "up_direction": CAMERA.up,
        }
    )
