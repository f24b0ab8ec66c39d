"""What is taken as an answer, and what is refused with which words."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import httpx
import pytest

from app.web.parts import SiteParts
from study_core.study import parse_study
from tests.support.screens import first_question, screens
from tests.support.server import ServerProcess
from tests.web.conftest import join, serving

ANSWER: dict[str, Any] = {"query_index": 0, "choice": "first", "response_time_ms": 900}


def test_an_answer_is_taken_once_and_brings_the_next_question(
    server: ServerProcess, client: httpx.Client
) -> None:
    token = join(server)
    first = client.post(f"/s/{token}/answer", json=ANSWER).json()
    assert first["outcome"] == "taken"
    assert first["screen"]["number"] == 2
    again = client.post(f"/s/{token}/answer", json={**ANSWER, "choice": "second"}).json()
    assert again["outcome"] == "already-taken"
    assert again["screen"]["position"] >= first["screen"]["position"]


@pytest.mark.parametrize("query_index", [1, 11, 12, -1, 10**12])
def test_an_answer_to_another_query_is_not_current(
    client: httpx.Client, token: str, query_index: int
) -> None:
    receipt = client.post(f"/s/{token}/answer", json={**ANSWER, "query_index": query_index}).json()
    assert receipt["outcome"] == "not-current"
    assert receipt["screen"]["query_index"] == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"choice": "c"}, "'a' or 'b'"),
        ({"choice": "A"}, "'a' or 'b'"),
        ({"choice": None}, "choice"),
        ({"choice": ["a"]}, "choice"),
        ({"response_time_ms": -1}, "response time"),
        ({"response_time_ms": 10**9}, "response time"),
        ({"response_time_ms": 1.5}, "response_time_ms"),
        ({"response_time_ms": "900"}, "response_time_ms"),
        ({"query_index": "0"}, "query_index"),
        ({"query_index": True}, "query_index"),
        ({"query_index": None}, "query_index"),
        ({"client": "none"}, "client"),
        ({"is_admin": True}, "is_admin"),
    ],
)
def test_an_impossible_answer_is_refused_with_the_reason(
    client: httpx.Client, token: str, change: dict[str, Any], said: str
) -> None:
    response = client.post(f"/s/{token}/answer", json={**ANSWER, **change})
    assert response.status_code == 422
    assert said in response.json()["error"]["message"]


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"null", b'"a"', b"\xff\xfe", b"[" * 5000])
def test_what_is_no_answer_at_all_is_refused(client: httpx.Client, token: str, content: bytes) -> None:
    headers = {"Content-Type": "application/json"}
    response = client.post(f"/s/{token}/answer", content=content, headers=headers)
    assert response.status_code in (400, 422)
    assert set(response.json()) == {"error"}


@pytest.mark.parametrize("missing", ["query_index", "choice", "response_time_ms"])
def test_an_answer_with_something_missing_is_refused(client: httpx.Client, token: str, missing: str) -> None:
    body = {key: value for key, value in ANSWER.items() if key != missing}
    response = client.post(f"/s/{token}/answer", json=body)
    assert response.status_code == 422
    assert missing in response.json()["error"]["message"]


def test_a_large_body_is_refused_before_it_is_read(client: httpx.Client, token: str) -> None:
    body = json.dumps({**ANSWER, "client": {"note": "x" * 70_000}}).encode()
    response = client.post(f"/s/{token}/answer", content=body)
    assert response.status_code == 413
    assert response.json()["error"]["code"] == "too-large"


def test_a_body_of_unknown_length_is_refused(client: httpx.Client, token: str) -> None:
    response = client.post(f"/s/{token}/answer", content=iter([json.dumps(ANSWER).encode()]))
    assert response.status_code == 411


@pytest.mark.parametrize(
    "origin", ["https://elsewhere.example", "null", "http://127.0.0.1:1", "not an origin"]
)
@pytest.mark.parametrize("path", ["/s/{token}/answer", "/s/{token}/stage", "/s/{token}/", "/join/quickstart"])
def test_a_page_of_somebody_else_can_write_nothing(
    client: httpx.Client, token: str, path: str, origin: str
) -> None:
    response = client.post(path.format(token=token), json=ANSWER, headers={"Origin": origin})
    assert response.status_code == 403
    assert response.json()["error"]["code"] == "foreign-origin"
    as_person = client.post(
        path.format(token=token), json=ANSWER, headers={"Origin": origin, "Accept": "text/html"}
    )
    assert as_person.status_code == 403
    assert as_person.headers["content-type"].startswith("text/html")


def test_our_own_page_can_answer(server: ServerProcess, client: httpx.Client) -> None:
    token = join(server)
    response = client.post(f"/s/{token}/answer", json=ANSWER, headers={"Origin": server.url})
    assert response.json()["outcome"] == "taken"


def test_a_refused_answer_leaves_the_question_open(client: httpx.Client, token: str) -> None:
    client.post(f"/s/{token}/answer", json={**ANSWER, "choice": "c"})
    client.post(f"/s/{token}/answer", json=ANSWER, headers={"Origin": "https://elsewhere.example"})
    screen = next(screens(client, f"/s/{token}/"))
    assert (screen["kind"], screen["query_index"]) == ("question", 0)


def test_a_page_has_a_button_for_every_answer_that_the_study_offers_and_the_answer_counts(
    parts: SiteParts,
) -> None:
    text = parts.study.text.replace("lapse_rate = 0.1", 'lapse_rate = 0.1\nanswers = ["a", "b", "skip"]')
    study = parse_study(text.replace('name = "quickstart"', 'name = "skips"'))
    parts.runtime.open_study(study)
    with serving(replace(parts, study=study)) as url, httpx.Client(base_url=url) as client:
        home = client.post("/join/skips", content=b"").headers["location"]
        first_question(client, home)
        page = client.get(home).text
        assert re.findall(r'data-choice="(\w+)"', page) == ["first", "second", "skip"]
        skipped = client.post(f"{home}answer", json={**ANSWER, "choice": "skip"}).json()
        assert skipped["outcome"] == "taken"
        assert skipped["screen"]["number"] == 2
        refused = client.post(f"{home}answer", json={**ANSWER, "choice": "unsure"})
        assert refused.status_code == 422
        assert "'skip'" in refused.json()["error"]["message"]
