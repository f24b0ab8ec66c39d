"""Pages for people, JSON for programs, and the headers of both."""

from __future__ import annotations

import httpx
import pytest

from app.settings import find_study
from tests.support.screens import screens
from tests.support.server import ServerProcess
from tests.support.wayfarer import BROWSER
from tests.web.conftest import TOKENS, join

UNKNOWN = [
    "/join/no-such-study",
    "/s/no-such-token/",
    "/s/no-such-token/screens",
    "/s/no-such-token/stage/",
    "/nothing/here",
    "/static/nothing.css",
]


def assert_safe(response: httpx.Response) -> None:
    """Checks the headers that every response of ours has."""
    headers = response.headers
    policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
    assert policy["frame-ancestors"] == "'self'"
    assert policy["base-uri"] == "'none'"
    assert policy["default-src"] in ("'self'", "'none'")
    assert "'unsafe-eval'" not in headers["content-security-policy"]
    assert headers["x-frame-options"] == "SAMEORIGIN"
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] in ("no-referrer", "same-origin")


def test_the_welcome_page_shows_the_study_file_and_a_button(client: httpx.Client) -> None:
    page = client.get("/join/quickstart", headers=BROWSER)
    assert page.status_code == 200
    study = find_study("quickstart")
    about = study.text_named("welcome", "en").strip().split("\n\n")
    for said in (study.title("en"), *about, "12 questions", "Begin"):
        assert " ".join(said.split()) in " ".join(page.text.split())


def test_the_form_of_the_welcome_page_comes_with_its_origin(client: httpx.Client) -> None:
    # Under `no-referrer` a browser would send "null", which is refused.
    assert client.get("/join/quickstart").headers["referrer-policy"] == "same-origin"
    with_origin = {"Origin": str(client.base_url).rstrip("/")}
    joined = client.post("/join/quickstart", content=b"", headers=with_origin)
    assert joined.status_code == 303
    TOKENS.append(joined.headers["location"].split("/")[2])


@pytest.mark.parametrize("path", UNKNOWN)
def test_an_unknown_address_is_a_page_for_people(client: httpx.Client, path: str) -> None:
    response = client.get(path, headers=BROWSER)
    assert response.status_code == 404
    assert response.headers["content-type"].startswith("text/html")
    assert "was copied" in response.text
    assert_safe(response)


@pytest.mark.parametrize("path", UNKNOWN)
def test_an_unknown_address_is_json_for_programs(client: httpx.Client, path: str) -> None:
    response = client.get(path)
    assert response.status_code == 404
    assert response.json()["error"]["code"] == "http-404"
    assert_safe(response)


@pytest.mark.parametrize("path", ["answer", "stage", ""])
def test_nobody_can_write_to_an_unknown_session(client: httpx.Client, path: str) -> None:
    body = (
        {"query_index": 0, "choice": "first", "response_time_ms": 1}
        if path == "answer"
        else {"action": "pause"}
    )
    assert client.post(f"/s/no-such-token/{path}", json=body).status_code == 404


@pytest.mark.parametrize(
    "path", ["/join/quickstart", "/s/{token}/", "/s/{token}/screens", "/s/{token}/stage/", "/healthz"]
)
def test_every_page_has_safe_headers(client: httpx.Client, token: str, path: str) -> None:
    with client.stream("GET", path.format(token=token), headers=BROWSER) as response:
        assert response.status_code == 200
        assert_safe(response)
    expected = "private, no-cache" if path.endswith("stage/") else "no-store"
    assert response.headers["cache-control"] == expected


@pytest.mark.parametrize(
    ("path", "policy"), [("/s/{token}/", "same-origin"), ("/s/{token}/stage/", "no-referrer")]
)
def test_pages_with_the_secret_in_their_address_send_it_to_no_other_site(
    client: httpx.Client, token: str, path: str, policy: str
) -> None:
    assert client.get(path.format(token=token)).headers["referrer-policy"] == policy


def test_the_way_back_is_a_cookie_that_scripts_cannot_read(client: httpx.Client) -> None:
    joined = client.post("/join/quickstart", content=b"")
    TOKENS.append(joined.headers["location"].split("/")[2])
    cookie = joined.headers["set-cookie"].lower()
    for attribute in ("httponly", "samesite=lax", "path=/join/quickstart"):
        assert attribute in cookie
    assert client.get("/join/quickstart").headers["location"] == joined.headers["location"]


def test_a_wrong_cookie_is_nobody(client: httpx.Client) -> None:
    client.cookies.set("prefstudy-session", "no-such-token", path="/join/quickstart")
    assert client.get("/join/quickstart").status_code == 200


def test_the_log_never_holds_a_secret(server: ServerProcess, client: httpx.Client) -> None:
    token = join(server)
    body = {"query_index": 0, "choice": "first", "response_time_ms": 700}
    assert client.post(f"/s/{token}/answer", json=body).json()["outcome"] == "taken"
    client.post(f"/s/{token}/answer", json={"choice": "?"})
    client.get(f"/s/{token}/nothing")
    next(screens(client, f"/s/{token}/"))
    log = (server.folder / "serve.log").read_text()
    assert len(TOKENS) > 0
    assert not [secret for secret in TOKENS if secret in log]
    assert "Traceback" not in log
