"""The site when something breaks or too many come, in this process, so that it can be made to."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import httpx
import pytest
import uvicorn

from app import wiring
from app.services import study as services
from app.settings import find_study
from app.web import site
from app.web.guard import JoinLimit
from tests.web.test_pages import BROWSER, assert_safe

JOINS = 3


@pytest.fixture
def url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of a site that lets three people a minute in."""
    monkeypatch.setattr(site, "JoinLimit", partial(JoinLimit, JOINS))
    database = f"sqlite:///{tmp_path / 'site.db'}"
    settings = wiring.ServeSettings(find_study("quickstart"), database, "127.0.0.1", 0, 1, None, None)
    with wiring.headless(database) as runtime:
        runtime.open_study(settings.study)
        config = uvicorn.Config(
            site.create_site(wiring._parts(settings, runtime)),
            port=0,
            log_level="critical",
            ws="websockets-sansio",
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
        server.should_exit = True
        thread.join()


def test_more_joins_than_a_minute_takes_are_asked_to_wait(url: str) -> None:
    with httpx.Client(base_url=url, timeout=60.0) as client:
        for _ in range(JOINS):
            assert client.post("/join/quickstart", content=b"").status_code == 303
        as_person = client.post("/join/quickstart", content=b"", headers=BROWSER)
        as_program = client.post("/join/quickstart", content=b"")
        assert client.get("/healthz").status_code == 200
    assert as_person.status_code == as_program.status_code == 429
    assert "try again in a minute" in as_person.text
    assert as_person.headers["content-type"].startswith("text/html")
    assert as_program.json()["error"]["code"] == "http-429"
    assert_safe(as_person)


def test_the_join_limit_forgets_after_a_minute_and_counts_addresses_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    limit = JoinLimit(per_minute=2)
    assert [limit.allows("one") for _ in range(3)] == [True, True, False]
    assert limit.allows("two")
    now[0] += 61.0
    assert limit.allows("one")


@pytest.mark.parametrize("path", ["/s/{token}/", "/s/{token}/screen"])
def test_a_traceback_never_reaches_a_page(url: str, monkeypatch: pytest.MonkeyPatch, path: str) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("a secret detail")

    with httpx.Client(base_url=url, timeout=60.0) as client:
        home = client.post("/join/quickstart", content=b"").headers["location"]
        monkeypatch.setattr(services, "screen", fail)
        address = path.format(token=home.strip("/").removeprefix("s/"))
        # A failure ends its connection.
        as_person = client.get(address, headers={**BROWSER, "Connection": "close"})
        as_program = client.get(address, headers={"Connection": "close"})
    assert as_person.status_code == as_program.status_code == 500
    for response in (as_person, as_program):
        assert "secret" not in response.text
        assert "Traceback" not in response.text
        assert "went wrong on our side" in response.text
        assert_safe(response)
    assert as_person.headers["content-type"].startswith("text/html")
    assert as_program.json()["error"]["code"] == "internal"
