"""The whole path, from the link to the last page: with every kind of hands, in both languages, and out of it again."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from app.settings import find_study
from app.store import SessionDeletedError, open_store
from study_core.path import Ending, Item
from tests.e2e.conftest import OpenPage
from tests.e2e.person import WAIT_MS, Person, at
from tests.e2e.walker import Hands, Keyboard, Mouse, Touch, Walker
from tests.support.server import ServerProcess, running_server

pytestmark = pytest.mark.browser

STUDY = find_study("full-path")
N_MAIN = STUDY.n_queries - STUDY.n_practice
WIDE = {"viewport": {"width": 1280, "height": 720}}
PHONE = {"viewport": {"width": 360, "height": 780}, "has_touch": True, "is_mobile": True}
SMALL = {"viewport": {"width": 640, "height": 480}}


@pytest.fixture(scope="module")
def full_path(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server of the study that has every kind of step."""
    with running_server(tmp_path_factory.mktemp("path"), STUDY.name) as started:
        yield started


def joined(
    open_page: OpenPage, server: ServerProcess, hands: Hands, query: str = "", **options: object
) -> Walker:
    """Returns somebody who has opened the study's link and begun."""
    page = open_page(**options)
    page.goto(f"{server.url}/join/{STUDY.name}{query}")
    hands.press(page.locator("button.begin"))
    page.wait_for_url("**/s/*/")
    return Walker(at(page, server), STUDY, hands)


def kinds(person: Person) -> list[str]:
    return [event.kind for event in person.stored()[1]]


def went_the_whole_way(walker: Walker) -> None:
    person = walker.person
    expect(person.page.locator("#completion-code")).to_have_text("FULLPATH-DONE", timeout=WAIT_MS)
    href = person.page.locator("#redirect").get_attribute("href")
    assert href == STUDY.file.endings[Ending.COMPLETED].redirect
    said = kinds(person)
    assert said.count("answer_given") == STUDY.n_queries
    assert said.count("break_taken") == (N_MAIN - 1) // 4
    steps = [event.payload for event in person.stored()[1] if event.kind == "step_taken"]
    assert [step["step"] for step in steps] == [0, 1, 2, 3, 5, 6, 7, 8, 9]
    assert {step["outcome"] for step in steps} == {"done"}
    assert person.problems == []


def test_by_mouse_on_a_wide_screen(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Mouse(), **WIDE)
    walker.walks()
    went_the_whole_way(walker)
    events = walker.person.stored()[1]
    remarks = [
        e.payload["content"].get("answers", {}).get("remarks") for e in events if e.kind == "step_taken"
    ]
    # Kept as it was typed.
    assert "Grüße <b>&" in remarks
    answers = walker.person.answers()
    assert {answer["confidence"] for answer in answers} == {4}
    # The first position was chosen every time: which trajectory that was, is another matter.
    first_shown = [event.payload["first_shown"] for event in events if event.kind == "query_prepared"]
    assert [answer["choice"] for answer in answers] == first_shown
    assert set(first_shown) == {"a", "b"}


@pytest.mark.slow
def test_with_nothing_but_the_keyboard(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Keyboard(), **SMALL)
    walker.walks()
    went_the_whole_way(walker)


def test_by_touch_on_a_small_phone(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Touch(), **PHONE)
    while (place := walker.place()) != "other":
        overflow = walker.page.evaluate("() => document.documentElement.scrollWidth - innerWidth")
        assert overflow <= 0, f"{place} is wider than the phone"
        walker.walks(until=lambda next_place, here=place: next_place != here)
    went_the_whole_way(walker)


RUNNING_OVER = """() => [...document.querySelectorAll("button, a.quiet, select")]
  .filter((one) => one.scrollWidth > one.clientWidth + 1)
  .map((one) => one.textContent)"""


@pytest.mark.parametrize("size", [(360, 640), (640, 360)], ids=["upright", "sideways"])
def test_no_words_run_over_their_button(
    full_path: ServerProcess, open_page: OpenPage, size: tuple[int, int]
) -> None:
    window = {"viewport": {"width": size[0], "height": size[1]}}
    walker = joined(open_page, full_path, Mouse(), "?lang=de", **window)
    walker.walks(until=lambda place: place == "trial")
    page = walker.page
    page.locator("#answer-first:enabled").click()
    expect(page.locator("[data-confidence='5']")).to_be_visible()
    assert page.evaluate(RUNNING_OVER) == []
    page.keyboard.press("Escape")
    assert page.evaluate(RUNNING_OVER) == []


@pytest.mark.slow
def test_in_the_second_language(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Mouse(), "?lang=de", **SMALL)
    seen = []
    while (place := walker.place()) != "other":
        assert walker.page.locator("html").get_attribute("lang") == "de"
        seen.append(walker.page.locator("body").inner_text())
        walker.walks(until=lambda next_place, here=place: next_place != here)
    went_the_whole_way(walker)
    text = " ".join(seen)
    assert STUDY.text_named("question", "de").strip() in text
    # What the interface says, not only the study.
    assert not re.search(r"\b(Leave|Go on|Question \d|Step \d|Replay|I prefer)\b", text)
    assert [e.payload for e in walker.person.stored()[1] if e.kind == "language_chosen"] == [
        {"language": "de"}
    ]


@pytest.mark.slow
def test_a_server_that_is_killed_between_any_two_steps(tmp_path: Path, open_page: OpenPage) -> None:
    with running_server(tmp_path, STUDY.name) as server:
        walker = joined(open_page, server, Mouse(), **SMALL)
        while (place := walker.place()) != "other":
            before = walker.person.stored()[1]
            server.kill()
            server.restart()
            walker.goes_on()
            assert walker.visited[-1] in (place, "break")
            # Whatever the log said is still there, and the step or question that was shown is the one taken.
            after = walker.person.stored()[1]
            assert after[: len(before)] == before
        expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-DONE", timeout=WAIT_MS)
        indices = [answer["query_index"] for answer in walker.person.answers()]
        assert indices == list(range(STUDY.n_queries))
        prepared = [e.payload["query_index"] for e in walker.person.stored()[1] if e.kind == "query_prepared"]
        assert prepared == indices


def test_declining_is_a_proper_end(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Mouse(), **SMALL)
    walker.page.locator("button[name=accept][value=no]").click()
    expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-DECLINED", timeout=WAIT_MS)
    walker.page.reload()
    expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-DECLINED", timeout=WAIT_MS)
    assert "query_prepared" not in kinds(walker.person)


def test_whom_the_study_is_not_for_is_told_so(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Mouse(), **SMALL)
    walker.answer_item = lambda item: "no" if item.name == "sees-animations" else None
    walker.walks()
    expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-SCREENED", timeout=WAIT_MS)


def wrong(item: Item) -> str | None:
    """An answer that is there to choose, and isn't right."""
    right = getattr(item, "right", None)
    options = [option.name for option in getattr(item, "options", ())]
    return next(option for option in options if option != right) if right is not None else None


def test_who_fails_the_check_twice_is_thanked(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Mouse(), **SMALL)
    walker.answer_item = wrong
    walker.walks()
    expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-FAILED", timeout=WAIT_MS)
    outcomes = [e.payload["outcome"] for e in walker.person.stored()[1] if e.kind == "step_taken"]
    assert outcomes[-2:] == ["again", "failed"]
    assert kinds(walker.person).count("answer_given") == STUDY.n_practice


def test_who_fails_the_check_once_goes_on_after_the_second_try(
    full_path: ServerProcess, open_page: OpenPage
) -> None:
    walker = joined(open_page, full_path, Mouse(), **SMALL)
    walker.walks(until=lambda place: place == "step 3")
    walker.answer_item = wrong
    walker.takes(STUDY.file.path[3])
    walker.answer_item = lambda item: None
    walker.walks(until=lambda place: place == "trial")
    outcomes = [e.payload["outcome"] for e in walker.person.stored()[1] if e.kind == "step_taken"]
    assert outcomes[-2:] == ["again", "done"]


def leaves_with(walker: Walker, what: str) -> None:
    """Goes by the way out that is on every page, and confirms."""
    page = walker.page
    page.locator("a[href='leave']").first.click()
    page.locator(f"a[href='leave?what={what}']").click()
    page.locator("form[action=stop] button").click()


def reaches_the_queries(walker: Walker) -> None:
    walker.walks(until=lambda place: place == "trial" and "break" in walker.visited)


@pytest.mark.slow
def test_stopping_keeps_the_answers(full_path: ServerProcess, open_page: OpenPage) -> None:
    walker = joined(open_page, full_path, Mouse(), **SMALL)
    reaches_the_queries(walker)
    n_answers = len(walker.person.answers())
    person_of = walker.person.session_in
    with open_store(full_path.database) as store:
        record = person_of(store)
    leaves_with(walker, "keep")
    expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-STOPPED", timeout=WAIT_MS)
    with open_store(full_path.database) as store:
        events = store.events(record.id)
    assert events[-1].payload == {"ending": "stopped"}
    assert sum(event.kind == "answer_given" for event in events) == n_answers


@pytest.mark.slow
def test_stopping_with_deletion_leaves_nothing_but_a_tombstone(tmp_path: Path, open_page: OpenPage) -> None:
    external_id = "prolific-5f2a9c-whom-nobody-else-knows"
    with running_server(tmp_path, STUDY.name) as server:
        query = f"?PROLIFIC_PID={external_id}&STUDY_ID=s1&SESSION_ID=x1"
        walker = joined(open_page, server, Mouse(), query, **SMALL)
        reaches_the_queries(walker)
        assert len(walker.person.answers()) > STUDY.n_practice
        token = walker.person.token
        record, events = walker.person.stored()
        clips = [event.payload["clips"]["wide"] for event in events if event.kind == "query_prepared"]
        leaves_with(walker, "delete")
        expect(walker.page.locator("#completion-code")).to_have_text("FULLPATH-DELETED", timeout=WAIT_MS)
    with open_store(server.database) as store:
        assert store.sessions() == []
        with pytest.raises(SessionDeletedError):
            store.events(record.id)
    kept = b"".join(path.read_bytes() for path in tmp_path.glob("serve.db*"))
    assert record.id.encode() in kept
    for trace in (external_id, token, *clips):
        assert trace.encode() not in kept
