"""What a person can do with a question besides pressing A or B."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.settings import find_study
from app.stage.clip import LEAD_S, TAIL_S
from app.store import open_store
from tests.e2e.conftest import OpenPage
from tests.e2e.curves import assert_on_stage
from tests.e2e.person import WAIT_MS, Person, join
from tests.support.server import ServerProcess, running_server

pytestmark = pytest.mark.browser

ANSWERING = Path(__file__).with_name("answering.toml")
N_QUERIES = find_study(str(ANSWERING)).n_queries


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """Serves a study that asks everything that can be asked of an answer."""
    with running_server(tmp_path_factory.mktemp("answering"), str(ANSWERING)) as started:
        yield started


@pytest.fixture
def person(server: ServerProcess, open_page: OpenPage) -> Person:
    """Somebody who has just begun that study."""
    return begins(open_page(viewport={"width": 760, "height": 480}), server)


def begins(page: Page, server: ServerProcess, name: str = "answering") -> Person:
    person = join(page, server, name)
    sees(person, 1)
    return person


def sees(person: Person, number: int, is_open: bool = True) -> None:
    """Waits for a question, and until it can be answered."""
    expect(person.page.locator("#count")).to_have_text(f"Question {number} of {N_QUERIES}", timeout=WAIT_MS)
    expect(person.page.locator("body")).not_to_have_class(re.compile("is-preparing"), timeout=WAIT_MS)
    if is_open:
        expect(person.page.locator("#answer-first")).to_be_enabled(timeout=WAIT_MS)


def measures(person: Person) -> list[dict[str, Any]]:
    """Returns what the browser measured, query by query."""
    with open_store(person.server.database) as store:
        return [row.measures for row in store.measures(person.session_in(store).id)]


def place(person: Person) -> float:
    """Where the slider is, in seconds of the loop."""
    return float(person.page.locator("#scrub").input_value())


def answers_surely(person: Person, key: str, confidence: int) -> None:
    person.presses(key)
    expect(person.page.get_by_role("heading", name="How sure are you?")).to_be_visible()
    person.presses(str(confidence))


def test_confidence_goes_with_the_answer_and_a_choice_can_be_changed_before(person: Person) -> None:
    answers_surely(person, "a", 4)
    sees(person, 2)
    person.presses("a")
    person.clicks("second")
    person.page.get_by_role("button", name="1 of 5: a guess").click()
    sees(person, 3)
    person.presses("b")
    person.presses("Escape")
    expect(person.page.get_by_role("heading", name="How sure are you?")).to_be_hidden()
    assert [answer["confidence"] for answer in person.answers()] == [4, 1]
    assert person.positions() == ["first", "second"]
    assert all(each["confidence_time_ms"] >= 0 for each in measures(person))
    assert person.problems == []


def test_other_answers_say_what_they_do_and_only_a_judgement_is_asked_for_its_confidence(
    person: Person,
) -> None:
    for name, effect in (("Can’t tell", "not counted"), ("About the same", "equally good")):
        expect(person.page.get_by_role("button", name=name)).to_have_accessible_description(effect)
    person.presses("c")
    sees(person, 2)
    answers_surely(person, "s", 2)
    sees(person, 3)
    person.page.get_by_role("button", name="Skip").click()
    given = [(answer["choice"], answer["confidence"]) for answer in wait_for_answers(person, 3)]
    assert given == [("unsure", None), ("same", 2), ("skip", None)]


def wait_for_answers(person: Person, number: int) -> list[dict[str, Any]]:
    for _ in range(WAIT_MS // 200):
        if len(person.answers()) >= number:
            break
        person.page.wait_for_timeout(200)
    return person.answers()


def test_the_last_answer_can_be_taken_back_and_given_again(person: Person) -> None:
    undo = person.page.get_by_role("button", name="Undo last answer")
    expect(undo).to_be_hidden()
    answers_surely(person, "a", 5)
    sees(person, 2)
    first = person.query(0)
    undo.click()
    sees(person, 1)
    expect(undo).to_be_hidden()
    person.watches()
    assert_on_stage(person.watches_until(lambda seen: len(seen) > 3), first)
    answers_surely(person, "b", 3)
    sees(person, 2)
    person.presses("u")
    sees(person, 1)
    answers_surely(person, "b", 3)
    sees(person, 2)
    kinds = [event.kind for event in person.stored()[1]]
    assert kinds.count("answer_given") == 3
    assert kinds.count("answer_taken_back") == 2
    expect(person.page.locator("#notice")).to_be_empty()


def test_a_break_comes_when_the_study_says_so_and_the_next_clip_begins_after_it(person: Person) -> None:
    for number in (1, 2, 3):
        sees(person, number)
        answers_surely(person, "a", 3)
    heading = person.page.get_by_role("heading", name="Time for a short break")
    expect(heading).to_be_visible(timeout=WAIT_MS)
    expect(heading).to_be_focused()
    expect(person.page.get_by_text(f"3 of {N_QUERIES} done")).to_be_visible()
    person.presses("a")
    person.page.reload()
    expect(heading).to_be_visible()
    person.page.wait_for_timeout(3000)
    person.page.get_by_role("button", name="Go on").click()
    sees(person, 4)
    assert place(person) < 2.0
    assert len(person.answers()) == 3
    expect(heading).to_be_hidden()


def test_the_slider_moves_the_cars_and_keeps_a_pause(person: Person) -> None:
    person.presses(" ")
    expect(person.page.get_by_role("button", name="Play", exact=True)).to_be_visible()
    slider = person.page.get_by_role("slider", name="Moment of both animations")
    slider.focus()
    person.presses("Home")
    person.page.wait_for_timeout(1500)
    person.watches()
    start = person.watches_until(lambda seen: len(seen) > 2)[-1]
    person.presses("End")
    person.watches_until(lambda seen: seen[-1] != start)
    assert person.page.get_by_role("button", name="Play", exact=True).is_visible()
    box = slider.bounding_box()
    assert box is not None
    person.page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    person.page.mouse.down()
    person.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2, steps=5)
    person.page.mouse.up()
    person.page.wait_for_timeout(2500)
    duration = float(slider.get_attribute("max") or 0)
    assert place(person) == pytest.approx(duration / 2, abs=0.2)
    assert person.page.get_by_role("button", name="Play", exact=True).is_visible()
    person.page.locator("#question").click()
    answers_surely(person, "a", 3)
    sees(person, 2)
    [measured] = measures(person)
    assert measured["pauses"] == 1
    assert measured["scrubs"] == 3


def test_a_playing_clip_that_is_dragged_plays_on_from_there(person: Person) -> None:
    slider = person.page.get_by_role("slider", name="Moment of both animations")
    box = slider.bounding_box()
    assert box is not None
    person.page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    person.page.mouse.down()
    person.page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + box["height"] / 2, steps=3)
    person.page.wait_for_timeout(1500)
    held = place(person)
    person.page.wait_for_timeout(500)
    assert place(person) == held
    person.page.mouse.up()
    person.page.wait_for_function(f"() => document.getElementById('scrub').value > {held + 0.5}")
    assert person.page.get_by_role("button", name="Pause", exact=True).is_visible()


def test_twice_the_speed_takes_half_the_time_and_holds_for_the_next_question(person: Person) -> None:
    person.page.get_by_label("Speed of both animations").select_option("2")
    person.page.wait_for_timeout(2000)
    pace = """() => new Promise((done) => {
      const slider = document.getElementById("scrub");
      let [from, at] = [null, 0];
      const look = (now) => {
        const place = Number(slider.value);
        if (from === null || place < from) [from, at] = [place, now];
        if (now - at > 1000) done((1000 * (place - from)) / (now - at));
        else requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    })"""
    assert person.page.evaluate(pace) == pytest.approx(2.0, rel=0.1)
    answers_surely(person, "a", 3)
    sees(person, 2)
    expect(person.page.get_by_label("Speed of both animations")).to_have_value("2")
    person.page.wait_for_timeout(1000)
    assert person.page.evaluate(pace) == pytest.approx(2.0, rel=0.1)
    assert measures(person)[0]["speed_changes"] == 1


def test_keys_can_be_changed_and_switched_off_and_stay_so(person: Person) -> None:
    page = person.page
    page.get_by_role("button", name="Keys").click()
    dialog = page.get_by_role("dialog", name="Keys")
    dialog.get_by_role("button", name="Prefer A").click()
    person.presses("j")
    expect(dialog.get_by_role("button", name="Prefer A J")).to_be_visible()
    dialog.get_by_role("button", name="Prefer B").click()
    person.presses("j")
    expect(dialog.get_by_role("button", name="Prefer A B")).to_be_visible()
    person.presses("Escape")
    expect(dialog).to_be_hidden()
    page.reload()
    sees(person, 1)
    person.presses("a")
    expect(page.locator("#answer-first")).not_to_have_class(re.compile("is-chosen"))
    answers_surely(person, "j", 3)
    sees(person, 2)
    assert person.positions() == ["second"]
    page.get_by_role("button", name="Keys").click()
    dialog.get_by_label("Use the keyboard").uncheck()
    dialog.get_by_role("button", name="Close").click()
    for key in ("j", "b", "ArrowLeft", "r"):
        person.presses(key)
    expect(page.locator(".is-chosen")).to_have_count(0)
    assert len(person.answers()) == 1


def test_whoever_wants_no_motion_gets_it_only_when_they_ask(
    server: ServerProcess, open_page: OpenPage
) -> None:
    person = begins(open_page(reduced_motion="reduce"), server)
    play = person.page.get_by_role("button", name="Play both")
    expect(play).to_be_visible()
    person.page.wait_for_timeout(1500)
    assert place(person) == 0.0
    play.click()
    expect(play).to_be_hidden()
    person.page.wait_for_function("() => document.getElementById('scrub').value > 1.5")
    answers_surely(person, "a", 3)
    sees(person, 2)
    expect(play).to_be_visible()
    assert place(person) == 0.0


def test_time_spent_elsewhere_and_the_pace_of_frames_are_measured(person: Person) -> None:
    person.page.evaluate(
        "() => { document.hasFocus = () => false; dispatchEvent(new Event('blur'));"
        " setTimeout(() => { delete document.hasFocus; dispatchEvent(new Event('focus')) }, 400) }"
    )
    person.page.wait_for_timeout(900)
    answers_surely(person, "a", 3)
    sees(person, 2)
    [measured] = measures(person)
    assert 350 < measured["out_of_focus_ms"] < 700
    assert measured["first_frame"] == "seen"
    assert measured["frame_ms"] > 5
    assert measured["stage_frame_ms"] > 5
    assert measured["viewport"] == [760, 480]
    assert measured["layout"] == "wide"


def test_an_answer_is_acknowledged_before_the_next_frame(person: Person) -> None:
    is_told, took_ms = person.page.evaluate(
        """() => {
          const button = document.getElementById("answer-first");
          const began = performance.now();
          button.click();
          return [button.matches(".is-chosen"), performance.now() - began];
        }"""
    )
    assert is_told
    assert took_ms < 100


@pytest.mark.slow
def test_both_drives_must_be_shown_to_their_end_where_the_study_says_so(
    tmp_path: Path, open_page: OpenPage
) -> None:
    text = ANSWERING.read_text().replace('name = "answering"', 'name = "watching"')
    study = tmp_path / "watching.toml"
    study.write_text(text.replace("confidence = true", "watch_once = true"))
    with running_server(tmp_path, str(study)) as server:
        person = join(open_page(), server, "watching")
        sees(person, 1, is_open=False)
        first = person.page.locator("#answer-first")
        expect(first).to_be_disabled()
        expect(first).to_contain_text(re.compile(r"in \d s"))
        # Nothing is gained by jumping to the end.
        person.page.get_by_role("slider").focus()
        person.presses("End")
        person.page.wait_for_timeout(500)
        expect(first).to_be_disabled()
        person.presses("a")
        expect(first).to_be_enabled(timeout=WAIT_MS)
        expect(first).to_contain_text("I prefer")
        person.page.locator("#question").click()
        person.presses("a")
        assert wait_for_answers(person, 1)[0]["response_time_ms"] > 1000 * (LEAD_S + TAIL_S)


@pytest.mark.slow
def test_whoever_finds_every_stage_taken_is_told_and_let_in_by_itself(
    server: ServerProcess, open_page: OpenPage
) -> None:
    page = open_page()
    busy = {"error": {"code": "stage-busy", "message": ""}}
    page.route("**/stage", lambda route: route.fulfill(status=409, json=busy))
    person = join(page, server, "answering")
    expect(page.get_by_role("heading", name="Many people are here just now")).to_be_visible(timeout=WAIT_MS)
    page.unroute_all(behavior="ignoreErrors")
    sees(person, 1)
    expect(page.get_by_role("heading", name="Many people are here just now")).to_be_hidden()


def test_arrows_mean_places_on_the_screen_whatever_the_direction_of_writing(
    server: ServerProcess, open_page: OpenPage
) -> None:
    person = begins(open_page(viewport={"width": 390, "height": 700}), server)
    person.page.evaluate("() => { document.documentElement.dir = 'rtl' }")
    boxes = [person.page.locator(f"#answer-{each}").bounding_box() for each in ("first", "second")]
    assert boxes[0] is not None
    assert boxes[1] is not None
    assert boxes[0]["x"] < boxes[1]["x"]
    answers_surely(person, "ArrowLeft", 3)
    sees(person, 2)
    assert person.positions() == ["first"]
