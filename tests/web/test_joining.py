"""The door as browsers find it: links with ids, and a study that is closed, full or unknown."""

from __future__ import annotations

import re
import sqlite3
import threading
from contextlib import closing
from dataclasses import replace
from urllib.parse import urlencode

import httpx
import pytest

from app.services.links import personal_link
from app.services.tokens import new_token
from app.settings import find_study
from study_core.study import parse_study
from tests.support.wayfarer import BROWSER
from tests.web.conftest import serving
from tests.web.place import LINK, PROLIFIC, STEPS, Opener, Place, begin, moment, ticket_in
from tests.web.test_pages import assert_safe


def test_a_link_of_prolific_leads_in_and_its_ids_are_kept(place: Place) -> None:
    with place.browser() as alice:
        home = begin(alice)
        assert re.fullmatch(r"/s/[\w-]{22}/", home)
        assert alice.get(home).status_code == 200
    (session,) = place.store.sessions()
    person = place.store.external_person(session.id)
    assert person is not None
    assert (person.study_name, person.external_id) == ("quickstart", "pid-of-alice")
    assert person.other_ids == {"STUDY_ID": "id-of-a-study", "SESSION_ID": "id-of-a-visit"}


@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_previewers_begin_nothing(place: Place, method: str) -> None:
    with place.browser() as previewer:
        for link in (LINK, "/join/quickstart", personal_link(place.store, "quickstart", "P07", place.url)):
            for _ in range(3):
                response = previewer.request(method, link)
                assert response.status_code == 200
                assert_safe(response)
    assert place.store.sessions() == []


def test_pressing_begin_twice_makes_one_session(place: Place) -> None:
    for link in (LINK, "/join/quickstart"):
        with place.browser() as browser:
            ticket = ticket_in(browser.get(link))
            first, second = (browser.post(link, data={"ticket": ticket}) for _ in range(2))
            assert first.headers["location"] == second.headers["location"] == f"/s/{ticket}/"
    assert len(place.store.sessions()) == 2


def test_two_simultaneous_joins_with_one_id_make_one_session(place: Place) -> None:
    start, found = threading.Barrier(6), []

    def come() -> None:
        with place.browser() as browser:
            ticket = ticket_in(browser.get(LINK))
            start.wait(timeout=30)
            found.append(browser.post(LINK, data={"ticket": ticket}))

    threads = [threading.Thread(target=come) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert sorted(response.status_code for response in found) == [200] * 5 + [303]
    assert len(place.store.sessions()) == 1


@pytest.mark.parametrize("value", ["", "{{%PROLIFIC_PID%}}", "x" * 201])
def test_a_link_whose_id_nobody_filled_in_is_told_in_words(place: Place, value: str) -> None:
    with place.browser() as alice:
        response = alice.get(f"/join/quickstart?{urlencode({'PROLIFIC_PID': value})}")
    assert response.status_code == 400
    assert "This link is not complete" in response.text


def test_without_cookies_the_way_in_shows_the_way_back(place: Place) -> None:
    with place.browser() as alice:
        ticket = ticket_in(alice.get(LINK))
        alice.cookies.clear()
        joined = alice.post(LINK, data={"ticket": ticket})
        assert joined.headers["location"] == f"/s/{ticket}/device?begin=1"
        alice.cookies.clear()
        page = alice.get(joined.headers["location"])
        assert "keeps no cookies" in page.text
        assert f"{place.url}/s/{ticket}/" in page.text
        # Everything works by the link alone.
        assert alice.get(f"/s/{ticket}/").status_code == 200
        again = alice.post(LINK, data={"ticket": ticket})
        assert again.headers["location"].startswith(f"/s/{ticket}/")
    assert len(place.store.sessions()) == 1


@pytest.mark.parametrize(
    ("sections", "status", "said"),
    [
        ("opens = 2099-12-01T09:00:00+01:00", 403, ["Tuesday, December 1, 2099", "9:00", "GMT+01:00"]),
        ("closes = 2020-12-01T09:00:00+01:00", 410, ["closed", "browser that you used then"]),
    ],
)
def test_a_study_that_takes_nobody_says_so_and_says_what_to_do(
    opened: Opener, sections: str, status: int, said: list[str]
) -> None:
    with opened(f"[recruitment]\n{sections}") as place, place.browser() as late:
        for response in (late.get(LINK), late.post(LINK, data={"ticket": new_token()})):
            assert response.status_code == status
            assert_safe(response)
            for words in said:
                assert words in response.text.replace("\u202f", " ")
        assert place.store.sessions() == []


def test_a_closed_or_full_study_sends_nobody_away_who_is_in(opened: Opener) -> None:
    with opened() as place, place.browser() as alice, place.browser() as bob:
        home = begin(alice)
        for sections in (f"closes = {moment(-1)}", f"opens = {moment(1)}", "places = 1"):
            study = parse_study(find_study("quickstart").text + STEPS + f"[recruitment]\n{sections}")
            with serving(replace(place.parts, study=study)) as url:
                assert alice.get(url + LINK).headers["location"] == home
                assert alice.get(url + home).status_code == 200
                refused = bob.get(f"{url}/join/quickstart?id=bob")
                assert refused.status_code in (403, 410)
        assert "All places in this study are taken" in refused.text


def test_somebody_killed_between_joining_and_beginning_goes_on(opened: Opener) -> None:
    with opened() as place, place.browser() as alice:
        ticket = ticket_in(alice.get(LINK))
        alice.post(LINK, data={"ticket": ticket})
        (session,) = place.store.sessions()
    # As the kill would have left it: the session is there, and nothing has happened in it.
    with closing(sqlite3.connect(place.database)) as rows, rows:
        rows.execute("DELETE FROM events")
    with opened() as place:
        alice = httpx.Client(base_url=place.url, timeout=60.0, headers=BROWSER, cookies=alice.cookies)
        with alice:
            home = alice.get(LINK).headers["location"]
            assert home == f"/s/{ticket}/"
            assert "Begin" in alice.get(home).text
            assert alice.post(home).headers["location"] == home
            assert [event.kind for event in place.store.events(session.id)] == ["session_begun"]
        assert place.store.sessions() == [session]


def test_somebody_who_has_finished_finds_the_way_back_to_the_last_page(place: Place) -> None:
    with place.browser() as shared:
        home = begin(shared, "/join/quickstart")
        shared.post(f"{home}stop", data={"what": "keep"})
        page = shared.get("/join/quickstart")
        assert f'href="{home}"' in page.text
        # The next person at this browser begins all the same, with a ticket of their own.
        assert begin(shared, "/join/quickstart") != home
    assert len(place.store.sessions()) == 2


def test_an_unknown_study_is_told_in_words(place: Place) -> None:
    with place.browser() as alice:
        for path in ("/join/another", "/join/another/resume", "/join/another/deleted"):
            response = alice.get(path)
            assert response.status_code == 404
            assert "was copied" in response.text


def test_the_language_of_the_link_is_the_language_of_the_session(place: Place) -> None:
    study = find_study("full-path")
    with serving(replace(place.parts, study=study)) as url, place.browser() as anna:
        link = f"{url}/join/full-path?lang=de&{urlencode(PROLIFIC)}"
        page = anna.get(link)
        assert '<html lang="de"' in page.text
        home = anna.post(link, data={"ticket": ticket_in(page)}).headers["location"]
        assert '<html lang="de"' in anna.get(url + home).text
    (session,) = place.store.sessions()
    assert [event.kind for event in place.store.events(session.id)] == ["session_begun", "language_chosen"]
    person = place.store.external_person(session.id)
    assert person is not None
    assert "lang" not in person.other_ids


def test_the_opening_is_told_as_the_persons_language_writes_it(place: Place) -> None:
    opening = "\n[recruitment]\nopens = 2099-12-01T09:00:00+01:00\n"
    study = parse_study(find_study("full-path").text + opening)
    with serving(replace(place.parts, study=study)) as url, place.browser() as anna:
        page = anna.get(f"{url}/join/full-path", headers={"Accept-Language": "de-CH, en;q=0.5"})
    assert page.status_code == 403
    assert "Dienstag, 1. Dezember 2099, 09:00 (GMT+01:00)" in page.text
