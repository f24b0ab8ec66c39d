"""What an open page is told: the screen at once, every change, and that the server is still there."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, cast

import httpx
import pytest

from app.services import study as services
from app.services.runtime import Runtime
from app.services.study import Screen
from app.web import screens as module
from app.web.changes import Changes
from app.web.parts import SiteParts
from app.web.screens import screen_events
from tests.support.screens import screens
from tests.support.server import ServerProcess
from tests.web.conftest import join

SESSION = "a session"


@dataclass
class MadeUp:
    """A session whose log grows when a test says so."""

    changes: Changes = field(default_factory=Changes)
    position: int = 1
    kind: str = "question"
    on_read: Callable[[], None] = lambda: None

    def screen(self, *_: object) -> Screen:
        read = Screen(self.kind, self.position, 0, 0, 1, 12, False, None, None, False)
        self.on_read()
        return read

    def grow(self, kind: str = "question") -> None:
        self.position += 1
        self.kind = kind
        self.changes.notify(SESSION)

    def events(self) -> AsyncIterator[str]:
        self.changes.start()
        return screen_events(cast(Runtime, None), SESSION, self.changes, lambda _: 3)


@pytest.fixture
def session(monkeypatch: pytest.MonkeyPatch) -> MadeUp:
    made_up = MadeUp()
    monkeypatch.setattr(services, "screen", made_up.screen)
    return made_up


def within_seconds(test: Callable[[], Awaitable[None]]) -> None:
    async def run() -> None:
        async with asyncio.timeout(10.0):
            await test()

    asyncio.run(run())


def test_the_screen_is_sent_at_once_and_after_each_change(session: MadeUp) -> None:
    async def test() -> None:
        events = session.events()
        for position in (1, 2, 3):
            event = await anext(events)
            assert event.startswith('data: {"kind": "question", ')
            assert f'"position": {position}, ' in event
            assert event.endswith('"stage_viewers": 3}\n\n')
            assert event.count("\n") == 2
            asyncio.get_running_loop().call_later(0.05, session.grow)

    within_seconds(test)


def test_a_change_while_the_screen_is_read_is_not_missed(session: MadeUp) -> None:
    def grow_once() -> None:
        session.on_read = lambda: None
        session.grow()

    async def test() -> None:
        session.on_read = grow_once
        events = session.events()
        assert '"position": 1' in await anext(events)
        assert '"position": 2' in await anext(events)

    within_seconds(test)


def test_the_screen_is_repeated_when_nothing_changes(
    session: MadeUp, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_LONGEST_SILENCE_S", 0.05)

    async def test() -> None:
        events = session.events()
        assert await anext(events) == await anext(events) == await anext(events)

    within_seconds(test)


def test_the_screen_of_a_finished_session_is_the_last_and_nobody_listens_any_more(session: MadeUp) -> None:
    async def test() -> None:
        events = session.events()
        await anext(events)
        session.grow("finished")
        (last,) = [event async for event in events]
        assert '"kind": "finished"' in last
        assert session.changes._waiting == {}

    within_seconds(test)


@pytest.mark.parametrize("moment", ["waiting", "reading", "beginning"])
def test_screens_end_with_the_server(session: MadeUp, moment: str) -> None:
    async def test() -> None:
        events = session.events()
        if moment == "beginning":
            session.changes.close()
        elif moment == "reading":
            loop = asyncio.get_running_loop()
            session.on_read = lambda: loop.call_soon_threadsafe(session.changes.close) and None
        else:
            asyncio.get_running_loop().call_later(0.05, session.changes.close)
        n_events = len([event async for event in events])
        assert n_events == (0 if moment == "beginning" else 1)

    within_seconds(test)


def test_a_change_reaches_two_tabs(server: ServerProcess, client: httpx.Client) -> None:
    home = f"/s/{join(server)}/"
    tabs = [screens(client, home), screens(client, home)]
    for tab in tabs:
        assert next(tab)["query_index"] == 0
    receipt = client.post(
        f"{home}answer", json={"query_index": 0, "choice": "first", "response_time_ms": 900}
    )
    assert receipt.json()["outcome"] == "taken"
    for tab in tabs:
        assert next(screen for screen in tab if screen["kind"] == "question")["query_index"] == 1


def test_screens_end_when_the_session_is_finished(server: ServerProcess, client: httpx.Client) -> None:
    home = f"/s/{join(server)}/"
    seen: list[dict[str, Any]] = []
    for screen in screens(client, home):
        seen.append(screen)
        if screen["kind"] == "question":
            body = {"query_index": screen["query_index"], "choice": "second", "response_time_ms": 900}
            client.post(f"{home}answer", json=body)
    assert seen[-1]["kind"] == "finished"
    assert {screen["query_index"] for screen in seen} == {*range(12), None}
    assert list(screens(client, home)) == [{**seen[-1]}]


def test_screens_are_an_event_stream_that_no_proxy_may_hold_back(client: httpx.Client, token: str) -> None:
    with client.stream("GET", f"/s/{token}/screens") as response:
        assert response.status_code == 200
        assert response.headers["content-type"].startswith("text/event-stream")
        assert response.headers["cache-control"] == "no-store"
        assert response.headers["x-accel-buffering"] == "no"


def test_a_page_that_is_gone_is_forgotten(parts: SiteParts, url: str) -> None:
    with httpx.Client(base_url=url, timeout=60.0) as client:
        home = client.post("/join/quickstart", content=b"").headers["location"]
        events = screens(client, home)
        next(events)
        assert len(parts.changes._waiting) == 1
        events.close()
        deadline = time.monotonic() + 10.0
        while parts.changes._waiting and time.monotonic() < deadline:
            time.sleep(0.01)
    assert parts.changes._waiting == {}
