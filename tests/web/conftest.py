"""The real site, in a process of its own or in this one, and a program that talks to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
import uvicorn

from app import wiring
from app.settings import find_study
from app.web.parts import SiteParts
from app.web.site import create_site
from study_core.study import parse_study
from tests.support.screens import first_question
from tests.support.server import ServerProcess, running_server
from tests.web.place import STEPS, Opener, Place

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
        first_question(visitor, home)
    TOKENS.append(home.strip("/").removeprefix("s/"))
    return TOKENS[-1]


@pytest.fixture
def parts(tmp_path: Path) -> Iterator[SiteParts]:
    """What a site in this process is made of."""
    database = f"sqlite:///{tmp_path / 'site.db'}"
    settings = wiring.ServeSettings(find_study("quickstart"), database, "127.0.0.1", 0, 1, None, None)
    with wiring.headless(database) as runtime:
        runtime.open_study(settings.study)
        yield wiring._parts(settings, runtime)


@pytest.fixture
def url(parts: SiteParts) -> Iterator[str]:
    """The address of a site in this process."""
    with serving(parts) as address:
        yield address


@contextmanager
def serving(parts: SiteParts) -> Iterator[str]:
    """Serves a site in this process, at the address that is given."""
    server = uvicorn.Server(
        uvicorn.Config(create_site(parts), port=0, log_level="critical", ws="websockets-sansio")
    )
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()


@pytest.fixture
def opened(tmp_path: Path) -> Opener:
    """Opens a site whose study has these sections besides; again, on the same database, if it was open before."""
    database = tmp_path / "site.db"

    @contextmanager
    def open_it(sections: str = "", steps: str = STEPS) -> Iterator[Place]:
        study = parse_study(find_study("quickstart").text + steps + sections)
        url = f"sqlite:///{database}"
        settings = wiring.ServeSettings(study, url, "127.0.0.1", 0, 1, None, None)
        with wiring.headless(url) as runtime:
            parts = wiring._parts(settings, runtime)
            with serving(parts) as address:
                yield Place(address, parts, database)

    return open_it


@pytest.fixture
def place(opened: Opener) -> Iterator[Place]:
    with opened() as site:
        yield site
