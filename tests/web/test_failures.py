"""The site when something breaks or too many come, in this process, so that it can be made to."""

from __future__ import annotations

import time

import httpx
import pytest

from app.services import study as services
from app.web import joining
from app.web.guard import RateLimit
from app.web.parts import SiteParts
from tests.support.screens import first_question, screens
from tests.support.wayfarer import BROWSER
from tests.web.test_pages import assert_safe

JOINS = 3


@pytest.fixture(autouse=True)
def few_joins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets three people a minute in."""
    monkeypatch.setattr(joining, "_JOINS_PER_MINUTE", JOINS)


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
    limit = RateLimit(per_minute=2)
    assert [limit.allows("one") for _ in range(3)] == [True, True, False]
    assert limit.allows("two")
    now[0] += 61.0
    assert limit.allows("one")


def fail(*_: object) -> None:
    raise RuntimeError("a secret detail")


def test_a_traceback_never_reaches_a_page(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with httpx.Client(base_url=url, timeout=60.0) as client:
        home = client.post("/join/quickstart", content=b"").headers["location"]
        monkeypatch.setattr(services, "screen", fail)
        # A failure ends its connection.
        as_person = client.get(home, headers={**BROWSER, "Connection": "close"})
        as_program = client.get(home, headers={"Connection": "close"})
    assert as_person.status_code == as_program.status_code == 500
    for response in (as_person, as_program):
        assert "secret" not in response.text
        assert "Traceback" not in response.text
        assert "went wrong on our side" in response.text
        assert_safe(response)
    assert as_person.headers["content-type"].startswith("text/html")
    assert as_program.json()["error"]["code"] == "internal"


def test_a_failure_breaks_the_stream_of_screens_without_a_word(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with httpx.Client(base_url=url, timeout=60.0) as client:
        home = client.post("/join/quickstart", content=b"").headers["location"]
        monkeypatch.setattr(services, "screen", fail)
        with pytest.raises(httpx.RemoteProtocolError, match="incomplete chunked read"):
            list(screens(client, home))


def test_who_was_deleted_while_answering_is_told_so_and_forgotten(parts: SiteParts, url: str) -> None:
    with httpx.Client(base_url=url, timeout=60.0) as person:
        home = person.post("/join/quickstart", content=b"").headers["location"]
        first_question(person, home)
        (record,) = parts.runtime.store.sessions()
        parts.runtime.store.delete_session(record.id)
        answer = {"query_index": 0, "choice": "first", "response_time_ms": 900}
        refused = person.post(f"{home}answer", json=answer)
        assert (refused.status_code, refused.json()["error"]["code"]) == (410, "deleted")
        assert person.get(home, headers=BROWSER).status_code == 404
        # Whoever opens the study's link again is a new person.
        assert person.get("/join/quickstart", headers=BROWSER).status_code == 200
