"""Whole sessions, and presses that mustn't count twice."""

from __future__ import annotations

import time

import pytest
from playwright.sync_api import Route, expect

from app.store import open_store
from tests.e2e.conftest import OpenPage
from tests.e2e.curves import assert_on_stage
from tests.e2e.person import N_QUERIES, POSITIONS, STUDY, Person, at, join
from tests.support.server import ServerProcess

pytestmark = pytest.mark.browser

PRESSED = [POSITIONS[each == "b"] for each in "abbaababbbaa"]
KEYS = {"first": ("a", "ArrowLeft", "ArrowUp"), "second": ("b", "ArrowRight", "ArrowDown")}


def test_a_session_by_mouse_and_keyboard_with_a_reload_is_stored_as_it_was_given(person: Person) -> None:
    started = time.monotonic()
    for index, position in enumerate(PRESSED):
        person.sees_question(index + 1)
        if index == 6:
            person.page.reload()
            person.sees_question(index + 1)
            assert len(person.answers()) == index
        if index % 2 == 0:
            person.clicks(position)
        else:
            person.presses(KEYS[position][index // 2 % 3])
    person.sees_the_end()
    took_ms = 1000 * (time.monotonic() - started)
    for _ in range(2):
        assert person.page.get_by_text(STUDY.text_named("thanks", "en").strip()).is_visible()
        assert person.page.locator("#answer-first").is_hidden()
        person.page.reload()
        person.sees_the_end()
    assert person.problems == []

    answers = person.answers()
    assert [answer["query_index"] for answer in answers] == list(range(N_QUERIES))
    assert person.positions() == PRESSED
    assert all(0 <= answer["response_time_ms"] < took_ms for answer in answers)
    assert sum(answer["response_time_ms"] for answer in answers) < took_ms
    with open_store(person.server.database) as store:
        record = person.session_in(store)
        assert [posterior.query_index for posterior in store.posteriors(record.id)] == list(range(9))
        means = {row.query_index: row.measures["means"] for row in store.measures(record.id)}
    assert {index: means[index] for index in range(4)} == {
        0: "mouse",
        1: "keyboard",
        2: "mouse",
        3: "keyboard",
    }


def test_a_double_click_is_one_answer(person: Person) -> None:
    person.sees_question(1)
    person.page.locator("#answer-second").dblclick()
    person.sees_question(2)
    assert person.positions() == ["second"]


def test_two_tabs_make_one_answer_and_go_on_to_the_same_query(
    server: ServerProcess, open_page: OpenPage
) -> None:
    first = join(open_page(), server)
    first.sees_question(1)
    second = at(first.page.context.new_page(), server)
    # The second tab hears nothing of what the first one does.
    held: list[Route] = []
    second.page.route("**/screens", lambda route: held.append(route))
    second.page.goto(first.page.url)
    second.sees_question(1)
    first.clicks("first")
    first.sees_question(2)
    second.clicks("second")
    expect(second.page.locator("#notice")).to_contain_text("in another window")
    second.sees_question(2)
    assert first.positions() == ["first"]
    # It would take the silence for a lost connection.
    second.page.unroute_all(behavior="ignoreErrors")
    for tab in (first, second):
        tab.watches()
        assert_on_stage(tab.watches_until(lambda seen: len(seen) > 3), first.query(1))


def test_a_tab_in_the_background_follows_the_other_one(server: ServerProcess, open_page: OpenPage) -> None:
    first = join(open_page(), server)
    second = at(first.page.context.new_page(), server)
    second.page.goto(first.page.url)
    for tab in (first, second):
        tab.sees_question(1)
    first.clicks("first")
    expect(second.page.locator("#notice")).to_contain_text("in another window")
    expect(first.page.locator("#notice")).to_be_empty()
    for tab in (first, second):
        tab.sees_question(2)


def test_the_participant_link_brings_a_returning_person_back_to_their_session(person: Person) -> None:
    person.sees_question(1)
    person.presses("b")
    person.sees_question(2)
    own_page = person.page.url
    person.page.goto(f"{person.server.url}/join/{STUDY.name}")
    person.sees_question(2)
    assert person.page.url == own_page
