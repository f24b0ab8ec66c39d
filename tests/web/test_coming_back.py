"""Coming back over HTTP: by cookie, personal address, resume code or signed link, and not by an id alone."""

from __future__ import annotations

import re
from dataclasses import replace

import httpx
import pytest

from app.services.links import personal_link
from app.services.tokens import new_token
from app.web import joining
from tests.web.conftest import serving
from tests.web.place import LINK, Opener, Place, begin, ticket_in
from tests.web.test_pages import assert_safe


def test_whoever_never_heard_that_they_are_in_is_in_when_they_reload(place: Place) -> None:
    with place.browser() as alice:
        ticket = ticket_in(alice.get(LINK))
        with place.browser() as same:
            # The same page, but the answer with its cookie gets lost.
            same.cookies = alice.cookies
            same.post(LINK, data={"ticket": ticket})
        assert alice.get(LINK).headers["location"] == f"/s/{ticket}/"
    assert len(place.store.sessions()) == 1


def test_the_browser_used_before_goes_straight_back(place: Place) -> None:
    with place.browser() as alice:
        home = begin(alice)
        again = alice.get(LINK)
        assert (again.status_code, again.headers["location"]) == (303, home)


def test_people_at_one_browser_one_after_another_are_each_themselves(place: Place) -> None:
    with place.browser() as shared:
        homes = [begin(shared, f"/join/quickstart?id={name}") for name in ("one", "two")]
        assert homes[0] != homes[1]
        for name, home in zip(("one", "two"), homes, strict=True):
            assert shared.get(f"/join/quickstart?id={name}").headers["location"] == home


def test_an_id_without_its_cookie_shows_nothing_and_deletes_nothing(place: Place) -> None:
    with place.browser() as alice, place.browser() as stranger:
        home = begin(alice)
        (session,) = place.store.sessions()
        before = place.store.events(session.id)
        page = stranger.get(LINK)
        assert page.status_code == 200
        assert "resume code" in page.text
        assert_safe(page)
        for response in (
            page,
            stranger.post(LINK, data={"ticket": new_token()}),
            stranger.post("/join/quickstart/resume", data={"code": "0000-0000-0000"}),
            stranger.post("/s/pid-of-alice/stop", data={"what": "delete"}),
            stranger.post(f"/s/{session.id}/stop", data={"what": "delete"}),
        ):
            assert "location" not in response.headers
            for secret in (home.split("/")[2], session.id, "pid-of-alice"):
                assert secret not in re.sub(r'action="[^"]*"', "", response.text)
        # A stranger's ticket of their own doesn't help either.
        own = ticket_in(stranger.get("/join/quickstart"))
        assert stranger.post(LINK, data={"ticket": own}).status_code == 200
        assert place.store.sessions() == [session]
        assert place.store.events(session.id) == before
        assert alice.get(home).status_code == 200


def test_a_finished_id_without_its_cookie_looks_like_any_other(place: Place) -> None:
    with place.browser() as alice, place.browser() as stranger:
        home = begin(alice)
        running = stranger.get(LINK).text
        alice.post(f"{home}stop", data={"what": "keep"})
        with place.browser() as another:
            assert another.get(LINK).text == running


def device_of(browser: httpx.Client, home: str) -> tuple[str, str]:
    page = browser.get(f"{home}device")
    assert page.status_code == 200
    assert_safe(page)
    link = re.search(r'href="([^"]+/s/[^"]+)"', page.text)
    code = re.search(r"\b\w{4}-\w{4}-\w{4}\b", page.text)
    assert link is not None
    assert code is not None
    return link[1], code[0]


def test_the_resume_code_brings_another_browser_in_and_keeps_it_in(place: Place) -> None:
    with place.browser() as alice, place.browser() as phone:
        home = begin(alice)
        _, code = device_of(alice, home)
        wrong = phone.post("/join/quickstart/resume", data={"code": code[:-1]})
        assert wrong.status_code == 403
        assert "No session has this code" in wrong.text
        right = phone.post("/join/quickstart/resume", data={"code": code.lower().replace("-", " ")})
        assert right.status_code == 303
        assert right.headers["location"] != home
        assert phone.get(LINK).headers["location"] == right.headers["location"]
        for browser, address in ((phone, right.headers["location"]), (alice, home)):
            assert browser.get(address).status_code == 200
    assert len(place.store.sessions()) == 1


def test_the_address_of_a_session_is_a_personal_link(place: Place) -> None:
    with place.browser() as alice, place.browser() as phone:
        home = begin(alice)
        link, _ = device_of(alice, home)
        assert link == f"{place.url}{home}"
        assert phone.get(link).status_code == 200


def test_the_personal_link_has_the_public_address(place: Place) -> None:
    parts = replace(place.parts, public_url="https://study.example")
    with serving(parts) as url, httpx.Client(base_url=url, timeout=60.0) as alice:
        home = alice.post("/join/quickstart").headers["location"]
        assert f"https://study.example{home}" in alice.get(f"{home}device").text


def test_no_page_leads_to_itself(place: Place) -> None:
    with place.browser() as alice:
        home = begin(alice)
        ways = {"device", "leave"}
        for here in ways:
            page = alice.get(f"{home}{here}").text
            assert {way for way in ways if f'href="{way}"' in page} == ways - {here}


def test_a_page_asks_for_the_code_of_whoever_has_no_link_with_an_id(place: Place) -> None:
    with place.browser() as phone:
        page = phone.get("/join/quickstart/resume")
        assert page.status_code == 200
        assert 'name="code"' in page.text


def test_codes_cannot_be_tried_at_will(opened: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joining, "_CODES_PER_MINUTE", 3)
    with opened() as place, place.browser() as stranger:
        tried = [
            stranger.post("/join/quickstart/resume", data={"code": f"{i:012d}"}).status_code for i in range(5)
        ]
    assert tried == [403] * 3 + [429] * 2


def test_a_signed_link_brings_its_person_back_in_any_browser(place: Place) -> None:
    link = personal_link(place.store, "quickstart", "P07", place.url)
    with place.browser() as lab, place.browser() as home:
        begin(lab, link)
        back = home.get(link)
        assert "Welcome back" in back.text
        assert_safe(back)
        again = home.post(link, data={"ticket": ticket_in(back)})
        assert home.get(again.headers["location"]).status_code == 200
        assert home.get(link).headers["location"] == again.headers["location"]
    assert len(place.store.sessions()) == 1


def test_a_wrong_signature_is_told_in_words_and_begins_nothing(place: Place) -> None:
    link = personal_link(place.store, "quickstart", "P07", place.url)
    with place.browser() as stranger:
        for wrong in (link[:-1], link.replace("P07", "P08")):
            for response in (stranger.get(wrong), stranger.post(wrong, data={"ticket": new_token()})):
                assert response.status_code == 403
                assert "This personal link is not right" in response.text
                assert_safe(response)
    assert place.store.sessions() == []
