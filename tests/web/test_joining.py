"""The door as browsers find it: coming in, coming back, stopping, deleting, over HTTP."""

from __future__ import annotations

import re
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import urlencode

import httpx
import pytest

from app import wiring
from app.services.links import personal_link
from app.services.tokens import new_token
from app.settings import find_study
from app.web import joining
from app.web.parts import SiteParts
from study_core.study import parse_study
from tests.support.screens import first_question
from tests.web.conftest import serving
from tests.web.test_pages import BROWSER, assert_safe

STEPS = '\n[[path]]\nstep = "text"\ntext = "welcome"\n[[path]]\nstep = "queries"\n'
PROLIFIC = {"PROLIFIC_PID": "pid-of-alice", "STUDY_ID": "id-of-a-study", "SESSION_ID": "id-of-a-visit"}
LINK = f"/join/quickstart?{urlencode(PROLIFIC)}"


class Place:
    """A site of its own, and what stands in its database."""

    def __init__(self, url: str, parts: SiteParts, database: Path) -> None:
        self.url, self.parts, self.store, self.database = url, parts, parts.runtime.store, database

    def browser(self) -> httpx.Client:
        """A browser of its own."""
        return httpx.Client(base_url=self.url, timeout=60.0, headers=BROWSER)

    def grow_old(self, hours: float) -> None:
        """Lets everybody have begun so many hours ago, and forgets what the process knows of them."""
        begun = (datetime.now(UTC) - timedelta(hours=hours)).strftime("%Y-%m-%d %H:%M:%S.%f")
        with closing(sqlite3.connect(self.database)) as rows, rows:
            rows.execute("UPDATE sessions SET created_at = ?", (begun,))
        for record in self.store.sessions():
            self.parts.runtime.forget(record.id)


Opener = Callable[..., AbstractContextManager[Place]]


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


def ticket_in(page: httpx.Response) -> str:
    found = re.search(r'name="ticket" value="([^"]+)"', page.text)
    assert found is not None, page.text
    return found[1]


def begin(browser: httpx.Client, link: str = LINK) -> str:
    """Opens a link and presses Begin, as a person does; returns the session's address."""
    page = browser.get(link)
    assert page.status_code == 200
    joined = browser.post(link, data={"ticket": ticket_in(page)})
    assert joined.status_code == 303, joined.text
    return joined.headers["location"]


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


def moment(hours: float) -> str:
    return (datetime.now(UTC).replace(microsecond=0) + timedelta(hours=hours)).isoformat()


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


def test_no_place_is_free_until_somebody_stops(opened: Opener) -> None:
    with opened("[recruitment]\nplaces = 1") as place, place.browser() as alice, place.browser() as bob:
        home = begin(alice)
        assert bob.get("/join/quickstart?id=bob").status_code == 403
        alice.post(f"{home}stop", data={"what": "keep"})
        begin(bob, "/join/quickstart?id=bob")


def test_stopping_asks_twice_and_keeps_the_answers(opened: Opener) -> None:
    ending = '[endings.stopped]\ncode = "STOP-7"\nredirect = "https://app.prolific.com/x?cc=STOP-7"'
    with opened(ending) as place, place.browser() as alice:
        home = begin(alice)
        choice = alice.get(f"{home}leave")
        for what in ("keep", "delete"):
            assert f"leave?what={what}" in choice.text
            page = alice.get(f"{home}leave?what={what}")
            assert f'value="{what}"' in page.text
            assert page.headers["referrer-policy"] == "same-origin"
            assert_safe(page)
        (session,) = place.store.sessions()
        assert place.store.ending(session.id) is None
        stopped = alice.post(f"{home}stop", data={"what": "keep"})
        assert stopped.headers["location"] == home
        # In this tab, in another one, by the study's link and after a restart: the same page, with its code.
        for _ in range(2):
            page = alice.get(home)
            assert "STOP-7" in page.text
            assert 'href="https://app.prolific.com/x?cc=STOP-7"' in page.text
            assert "refresh" not in page.text.lower()
        assert alice.get(LINK).headers["location"] == home
        assert place.store.ending(session.id) == "stopped"
        assert alice.post(f"{home}stop", data={"what": "keep"}).status_code == 303
        assert [event.kind for event in place.store.events(session.id)].count("session_ended") == 1
    with opened(ending) as place, place.browser() as later:
        assert "STOP-7" in later.get(home).text


@pytest.mark.parametrize("form", [{}, {"what": "both"}, {"what": ["keep", "delete"]}])
def test_whoever_chooses_nothing_stays(place: Place, form: dict[str, str]) -> None:
    with place.browser() as alice:
        home = begin(alice)
        undecided = alice.post(f"{home}stop", data=form)
        assert undecided.status_code == 422
        assert "Nothing was changed" in undecided.text
        assert alice.get(home).status_code == 200
    (session,) = place.store.sessions()
    assert place.store.ending(session.id) is None


def traces(database: Path, secret: str) -> list[str]:
    """The files of the database that hold a text."""
    return [
        path.name
        for path in database.parent.glob(f"{database.name}*")
        if secret.encode() in path.read_bytes()
    ]


def test_deleting_leaves_nothing_but_the_tombstone(opened: Opener) -> None:
    measured = "measured-nowhere-else"
    deleted_ending = '[endings.deleted]\ncode = "GONE-9"'
    with opened(deleted_ending, steps="") as place, place.browser() as alice, place.browser() as bob:
        home = begin(alice)
        bobs = begin(bob, "/join/quickstart?id=bob")
        first_question(alice, home)
        answer = {"query_index": 0, "choice": "first", "response_time_ms": 12_345}
        given = alice.post(f"{home}answer", json={**answer, "client": {"note": measured}})
        assert given.json()["outcome"] == "taken"
        second_tab = alice.get(home)
        assert second_tab.status_code == 200
        (session, other) = place.store.sessions()
        secrets = ["pid-of-alice", "id-of-a-visit", measured, "12345"]
        assert [secret for secret in secrets if not traces(place.database, secret)] == []

        gone = alice.post(f"{home}stop", data={"what": "delete"})
        assert gone.status_code == 303
        assert [secret for secret in secrets if traces(place.database, secret)] == []
        with closing(sqlite3.connect(place.database)) as rows:
            tables = [name for (name,) in rows.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            holding = {
                table
                for table in tables
                for row in rows.execute(f"SELECT * FROM {table}")
                if session.id in row
            }
        assert holding == {"tombstones"}
        assert place.store.sessions() == [other]

        # The page says what happened, also when it is loaded again, and the cookie is gone.
        for _ in range(2):
            farewell = alice.get(gone.headers["location"])
            assert farewell.status_code == 200
            assert "GONE-9" in farewell.text
            assert "published" in farewell.text
            assert_safe(farewell)
        assert not alice.cookies
        for response in (
            alice.get(home),
            alice.post(f"{home}stop", data={"what": "delete"}),
            alice.post(f"{home}answer", json={**answer, "query_index": 1}),
        ):
            assert response.status_code in (404, 410)
        assert "deleted your answers" in alice.get(home).text
        assert bob.get(bobs).status_code == 200


def test_whoever_has_finished_may_still_delete_everything(place: Place) -> None:
    with place.browser() as alice:
        home = begin(alice)
        alice.post(f"{home}stop", data={"what": "keep"})
        assert "leave" in alice.get(home).text
        assert 'value="delete"' in alice.get(f"{home}leave").text
        assert alice.post(f"{home}stop", data={"what": "delete"}).status_code == 303
    assert place.store.sessions() == []


def test_the_last_page_of_a_deleted_session_cannot_be_made_up(place: Place) -> None:
    with place.browser() as stranger:
        for query in ("", f"version={place.parts.study.hash}&at={moment(0)}&signature=x"):
            assert stranger.get(f"/join/quickstart/deleted?{query}").status_code == 403


@pytest.fixture
def old(opened: Opener, request: pytest.FixtureRequest) -> Iterator[tuple[Place, httpx.Client, str]]:
    """Somebody who began three hours ago in a study with a maximum age of two."""
    sections = (
        f'[session]\nmax_age_hours = 2\nwhen_old = "{request.param}"\n[endings.timed-out]\ncode = "LATE-5"'
    )
    with opened(sections) as place, place.browser() as alice:
        home = begin(alice)
        place.grow_old(3)
        yield place, alice, home


@pytest.mark.parametrize("old", ["end"], indirect=True)
def test_whoever_comes_back_too_late_is_told_so_with_a_code_of_its_own(
    old: tuple[Place, httpx.Client, str],
) -> None:
    place, alice, home = old
    assert alice.get(LINK).headers["location"] == home
    page = alice.get(home)
    assert "LATE-5" in page.text
    assert "begin_again" not in page.text
    assert 'action="again"' not in page.text
    assert alice.post(f"{home}again").headers["location"] == home
    (session,) = place.store.sessions()
    assert place.store.ending(session.id) == "timed-out"


@pytest.mark.parametrize("old", ["restart"], indirect=True)
def test_whoever_comes_back_too_late_may_begin_again_once(old: tuple[Place, httpx.Client, str]) -> None:
    place, alice, home = old
    assert 'action="again"' in alice.get(home).text
    first, second = (alice.post(f"{home}again") for _ in range(2))
    new_home = first.headers["location"]
    assert second.headers["location"] == new_home != home
    # The old address, the study's link and the new address all lead to the new session.
    assert alice.get(home).headers["location"] == new_home
    assert alice.get(LINK).headers["location"] == new_home
    assert alice.get(new_home).status_code == 200
    old_session, new_session = place.store.sessions()
    assert place.store.ending(old_session.id) == "timed-out"
    assert place.store.ending(new_session.id) is None
    # Both are one person's, and are deleted together.
    alice.post(f"{new_home}stop", data={"what": "delete"})
    assert place.store.sessions() == []
    assert traces(place.database, "pid-of-alice") == []


@pytest.mark.parametrize("old", ["restart"], indirect=True)
def test_in_a_closed_study_nobody_begins_again(old: tuple[Place, httpx.Client, str]) -> None:
    place, alice, home = old
    alice.get(home)
    study = parse_study(place.parts.study.text + f"\n[recruitment]\ncloses = {moment(-1)}")
    with serving(replace(place.parts, study=study)) as url:
        assert alice.post(f"{url}{home}again").status_code == 410
    assert len(place.store.sessions()) == 1


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
