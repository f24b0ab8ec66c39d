"""The real site in a process of its own, and a program that talks to it."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from tests.support.server import ServerProcess, running_server

TOKENS: list[str] = []
"""Every secret that these tests have been given."""


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with running_server(tmp_path_factory.mktemp("web")) as started:
        yield started


@pytest.fixture
def client(server: ServerProcess) -> Iterator[httpx.Client]:
    """A program without cookies yet, that follows nothing."""
    with httpx.Client(base_url=server.url, timeout=60.0) as opened:
        yield opened


@pytest.fixture(scope="session")
def token(server: ServerProcess) -> str:
    """The secret of a session that stays at its first question."""
    return join(server)


def join(server: ServerProcess) -> str:
    """Joins as a new person, waits for the first question, and returns the session's secret."""
    with httpx.Client(base_url=server.url, timeout=60.0) as visitor:
        joined = visitor.post("/join/quickstart", content=b"")
        assert joined.status_code == 303
        home = joined.headers["location"]
        screen = visitor.get(f"{home}screen?after=-1").json()
        while screen["kind"] != "question":
            screen = visitor.get(f"{home}screen?after={screen['position']}").json()
    TOKENS.append(home.strip("/").removeprefix("s/"))
    return TOKENS[-1]
