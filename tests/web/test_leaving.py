"""Leaving over HTTP: stopping, deleting, and coming back too late."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from study_core.study import parse_study
from tests.support.screens import first_question
from tests.web.conftest import serving
from tests.web.place import LINK, Opener, Place, begin, moment
from tests.web.test_pages import assert_safe


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
