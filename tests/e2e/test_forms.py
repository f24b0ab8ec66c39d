"""The forms of the path: kept over a reload, sent when the network is back, usable by keyboard and without scripts."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from app.settings import find_study
from tests.e2e.conftest import OpenPage
from tests.support.server import ServerProcess, running_server
from tests.support.wayfarer import Wayfarer

pytestmark = pytest.mark.browser

STUDY = find_study("full-path")
TASK_LOAD, CLOSING, DEBRIEF = 6, 8, 9


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server of the study that has every kind of step."""
    with running_server(tmp_path_factory.mktemp("forms"), STUDY.name) as started:
        yield started


@pytest.fixture
def somebody(server: ServerProcess) -> Iterator[Wayfarer]:
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        yield Wayfarer(client, STUDY)


def visit(page: Page, server: ServerProcess, somebody: Wayfarer) -> Page:
    page.goto(server.url + somebody.home)
    return page


def sliders(page: Page) -> list[str]:
    """Returns what the sliders say of themselves."""
    said = page.locator("input[type=range]")
    return [str(said.nth(i).get_attribute("aria-valuetext")) for i in range(said.count())]


def test_a_scale_has_no_answer_until_somebody_gives_one(
    server: ServerProcess, somebody: Wayfarer, open_page: OpenPage
) -> None:
    somebody.go_to_step(TASK_LOAD)
    page = visit(open_page(), server, somebody)
    assert sliders(page) == ["Not answered yet"] * 6
    page.locator("main .begin").click()
    expect(page.locator("#summary")).to_be_focused()
    expect(page.locator("#summary a")).to_have_count(6)
    # By keyboard: one step from the middle, the middle itself, and an end.
    for number, key in enumerate(["ArrowRight", "Enter", "End"]):
        page.locator("input[type=range]").nth(number).focus()
        page.keyboard.press(key)
    page.locator("input[type=range]").nth(3).click()
    assert sliders(page) == ["55 of 100", "50 of 100", "100 of 100", "50 of 100", *["Not answered yet"] * 2]
    page.locator("main .begin").click()
    expect(page.locator("#summary a")).to_have_count(2)
    assert sliders(page)[:4] == ["55 of 100", "50 of 100", "100 of 100", "50 of 100"]


def test_what_was_typed_survives_a_reload_and_a_lost_network(
    server: ServerProcess, somebody: Wayfarer, open_page: OpenPage
) -> None:
    somebody.go_to_step(CLOSING)
    page = visit(open_page(), server, somebody)
    page.get_by_label("6").check()
    page.get_by_label("How it kept its lane").check()
    page.locator("textarea").fill("Nice <cars>")
    page.reload()
    expect(page.get_by_label("6")).to_be_checked()
    expect(page.get_by_label("How it kept its lane")).to_be_checked()
    expect(page.locator("textarea")).to_have_value("Nice <cars>")
    page.context.set_offline(True)
    page.locator("main .begin").click()
    expect(page.locator("#notice")).to_contain_text("What you entered is kept")
    assert somebody.screen()["step"] == CLOSING
    page.context.set_offline(False)
    expect(page.get_by_role("heading", name="What this was about")).to_be_visible(timeout=30_000)
    assert page.evaluate("() => sessionStorage.length") == 0


def test_every_form_works_without_scripts(
    server: ServerProcess, somebody: Wayfarer, open_page: OpenPage
) -> None:
    page = visit(open_page(java_script_enabled=False), server, somebody)
    page.get_by_role("button", name="I agree").click()
    page.get_by_label("Yes").check()
    page.locator("main .begin").click()
    expect(page.get_by_role("heading", name="What you will do")).to_be_visible()
    somebody.go_to_step(TASK_LOAD)
    page.goto(server.url + somebody.home)
    for number in range(6):
        page.locator("input.is-number").nth(number).fill("45" if number else "46")
    page.locator("main .begin").click()
    # Not a multiple of five: said at the question, and what was typed is still there.
    expect(page.locator(".has-problem")).to_have_count(1)
    expect(page.locator("input.is-number").first).to_have_value("46")
    page.locator("input.is-number").first.fill("45")
    page.locator("main .begin").click()
    expect(page.get_by_label("How old are you")).to_be_visible()


def test_the_code_can_be_copied(server: ServerProcess, somebody: Wayfarer, open_page: OpenPage) -> None:
    somebody.go_until(lambda screen: screen["kind"] == "finished")
    page = visit(open_page(permissions=["clipboard-read", "clipboard-write"]), server, somebody)
    page.get_by_role("button", name="Copy the code").click()
    expect(page.get_by_role("button", name="Copied")).to_be_visible()
    assert page.evaluate("() => navigator.clipboard.readText()") == "FULLPATH-DONE"
