"""What a person sees besides the cars, on large and small screens, and where something is missing."""

from __future__ import annotations

import pytest
from playwright.sync_api import Locator, Page, expect

from app.stage.framing import Layout
from tests.e2e.conftest import Launch, OpenPage
from tests.e2e.curves import assert_on_stage
from tests.e2e.person import STUDY, WAIT_MS, Person, join
from tests.support.server import ServerProcess

pytestmark = pytest.mark.browser

FINGER = 44.0
PHONES = {"a usual phone": (390, 844), "a small phone": (360, 640)}


def box(locator: Locator) -> tuple[float, float, float, float]:
    found = locator.bounding_box()
    assert found is not None
    return found["x"], found["y"], found["width"], found["height"]


def overflow(page: Page) -> tuple[int, int]:
    """How far the page can be scrolled, across and down."""
    across, down = page.evaluate(
        "() => { const e = document.scrollingElement;"
        " return [e.scrollWidth - e.clientWidth, e.scrollHeight - e.clientHeight] }"
    )
    return across, down


@pytest.mark.parametrize("size", PHONES.values(), ids=PHONES)
def test_a_phone_held_upright_shows_the_sides_next_to_each_other_and_takes_touches(
    server: ServerProcess, open_page: OpenPage, size: tuple[int, int]
) -> None:
    width, height = size
    page = open_page(
        viewport={"width": width, "height": height}, has_touch=True, is_mobile=True, device_scale_factor=1
    )
    person = join(page, server)
    person.sees_question(1)
    assert overflow(page) == (0, 0)
    for name in ("answer-first", "answer-second", "replay", "pause", "scrub", "speed", "leave"):
        x, y, w, h = box(page.locator(f"#{name}"))
        assert min(w, h) >= FINGER
        assert x >= 0
        assert y >= 0
        assert x + w <= width
        assert y + h <= height
    person.watches()
    assert_on_stage(person.watches_until(lambda seen: len(seen) > 3), person.query(0), Layout.TALL)
    page.locator("#answer-second").tap()
    person.sees_question(2)
    assert person.positions() == ["second"]
    assert overflow(page) == (0, 0)


def test_a_wide_window_of_any_size_shows_everything_without_scrolling(person: Person) -> None:
    person.sees_question(1)
    for width, height in ((2560, 1440), (1280, 720), (1024, 600), (844, 390), (780, 360)):
        person.page.set_viewport_size({"width": width, "height": height})
        assert overflow(person.page) == (0, 0)
        _, _, w, h = box(person.page.locator(".pane"))
        assert w / h == pytest.approx(Layout.WIDE.aspect, rel=0.01)
        assert w * h > 0.35 * width * height


def test_turning_a_phone_rearranges_the_sides_of_the_same_query(person: Person) -> None:
    person.sees_question(1)
    person.page.set_viewport_size({"width": 390, "height": 700})

    def is_rearranged() -> bool:
        person.watches()
        seen = person.watches_until(lambda seen: len(seen) > 3)
        try:
            assert_on_stage(seen, person.query(0), Layout.TALL)
        except AssertionError:
            return False
        return True

    assert any(is_rearranged() for _ in range(60))
    assert overflow(person.page) == (0, 0)


def test_nothing_of_the_viewer_itself_is_to_be_seen(person: Person) -> None:
    person.sees_question(1)
    person.watches()
    person.watches_until(lambda seen: len(seen) > 3)
    assert person.stage.evaluate("() => document.body.innerText.trim()") == ""
    n_shown = person.stage.evaluate(
        "() => [...document.querySelectorAll('button, input, a, [role=button], [data-floating-window]')]"
        ".filter((each) => each.getClientRects().length > 0).length"
    )
    assert n_shown == 0
    assert person.token not in person.page.locator("body").inner_text()


def test_the_mouse_cannot_move_the_camera_or_the_focus_into_the_stage(person: Person) -> None:
    person.sees_question(1)
    x, y, w, h = box(person.page.locator(".pane"))
    person.page.mouse.move(x + w / 2, y + h / 2)
    person.page.mouse.down()
    person.page.mouse.move(x + w / 4, y + h / 4, steps=4)
    person.page.mouse.up()
    person.page.mouse.wheel(0, 300)
    person.watches()
    assert_on_stage(person.watches_until(lambda seen: len(seen) > 5), person.query(0))
    person.presses("a")
    person.sees_question(2)


def test_a_pointer_that_rests_on_an_answer_does_not_make_it_look_chosen(person: Person) -> None:
    person.sees_question(1)
    person.clicks("first")
    person.sees_question(2)
    first, second = (person.page.locator(f"#answer-{position}") for position in ("first", "second"))
    first.hover()
    person.page.wait_for_timeout(300)
    painted = [each.evaluate("(e) => getComputedStyle(e).backgroundColor") for each in (first, second)]
    assert painted[0] == painted[1]


@pytest.mark.parametrize("size", [(300, 500), (640, 280)], ids=["narrow", "low"])
def test_a_window_that_is_too_small_says_so_until_there_is_room(
    server: ServerProcess, open_page: OpenPage, size: tuple[int, int]
) -> None:
    person = join(open_page(), server)
    person.sees_question(1)
    person.page.set_viewport_size({"width": size[0], "height": size[1]})
    told = person.page.get_by_role("heading", name="There is too little room here")
    expect(told).to_be_visible()
    person.presses("a")
    person.page.set_viewport_size({"width": 640, "height": 420})
    expect(told).to_be_hidden()
    person.sees_question(1)
    person.presses("b")
    person.sees_question(2)
    assert person.positions() == ["second"]


def test_a_browser_without_webgl_is_told_so_and_what_to_do(server: ServerProcess, launch: Launch) -> None:
    browser = launch("--disable-gpu", "--disable-3d-apis")
    page = browser.new_page()
    page.goto(f"{server.url}/join/{STUDY.name}")
    expect(page.get_by_role("heading", name="This browser can’t show the animations")).to_be_visible()
    person = join(page, server)
    expect(person.page.get_by_role("alert")).to_contain_text("can’t show the animations", timeout=WAIT_MS)
    expect(person.page.get_by_role("button", name="Try again")).to_be_visible()
    person.presses("a")
    assert person.answers() == []
    browser.close()


def test_a_browser_without_javascript_is_told_so(server: ServerProcess, open_page: OpenPage) -> None:
    page = open_page(java_script_enabled=False)
    page.goto(f"{server.url}/join/{STUDY.name}")
    expect(page.get_by_role("heading", name="JavaScript is switched off")).to_be_visible()
    person = join(page, server)
    expect(person.page.get_by_role("heading", name="JavaScript is switched off")).to_be_visible()


def test_the_welcome_page_says_what_the_study_file_says(server: ServerProcess, open_page: OpenPage) -> None:
    page = open_page()
    page.goto(f"{server.url}/join/{STUDY.name}")
    expect(page.get_by_role("heading", level=1)).to_have_text(STUDY.file.title)
    paragraphs = STUDY.text_named("welcome", "en").strip().split("\n\n")
    assert page.locator(".text p").all_inner_texts()[: len(paragraphs)] == paragraphs
    expect(page.get_by_text("12 questions")).to_be_visible()
    expect(page.locator(".not-yet")).to_be_hidden()
    assert overflow(page)[0] == 0
