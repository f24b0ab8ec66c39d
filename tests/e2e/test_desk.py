"""The desk in a real browser: its first owner, a monitor that keeps up by itself, and one person's page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import OpenPage
from tests.e2e.person import join
from tests.e2e.test_accessibility import AXE, LOOKS, barriers
from tests.support.server import ServerProcess, running_server

pytestmark = pytest.mark.browser

PASSWORD = "correct horse battery"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server whose desk nobody has yet."""
    if not AXE.exists():
        pytest.skip("axe-core is not installed; `make node_modules/axe.stamp` does that")
    with running_server(tmp_path_factory.mktemp("desk")) as started:
        yield started


def printed_code(server: ServerProcess) -> str:
    """The set-up code, as it stands on the server's terminal."""
    assert server.process.stdout is not None
    for line in server.process.stdout:
        found = re.search(r"needs this code: (\S+)", line)
        if found:
            return found[1]
    raise AssertionError("the server printed no code")


def check(page: Page) -> None:
    """Looks for barriers, and for anything that the content security policy had to stop."""
    assert barriers(page) == []


def test_from_the_first_owner_to_somebody_who_is_excluded(server: ServerProcess, open_page: OpenPage) -> None:
    desk = open_page(viewport={"width": 1280, "height": 800})
    complaints: list[str] = []
    desk.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    desk.on("pageerror", lambda error: complaints.append(str(error)))

    desk.goto(f"{server.url}/desk")
    check(desk)
    # By keyboard alone.
    desk.get_by_label("Set-up code").focus()
    desk.keyboard.type(printed_code(server))
    for typed in ("olga", PASSWORD):
        desk.keyboard.press("Tab")
        desk.keyboard.type(typed)
    desk.keyboard.press("Enter")
    expect(desk.get_by_role("heading", name="Studies")).to_be_visible()
    check(desk)

    desk.get_by_role("link", name="How should a car drive?").click()
    expect(desk.get_by_text("Nobody yet. The links lead people here.")).to_be_visible()
    check(desk)

    somebody = join(open_page(), server)
    row = desk.get_by_role("row").filter(has=desk.get_by_role("link", name="1", exact=True))
    expect(row).to_contain_text("Questions")
    somebody.sees_question(1)
    somebody.clicks("first")
    expect(row.get_by_role("cell").nth(1)).to_contain_text("1 / 12")
    check(desk)

    desk.get_by_role("link", name="1", exact=True).focus()
    desk.keyboard.press("Enter")
    expect(desk.get_by_role("heading", name="Person 1")).to_be_visible()
    check(desk)
    desk.get_by_label("Excluded").check()
    desk.get_by_label("Reason").fill("pressed A without looking")
    desk.get_by_role("button", name="Save").click()
    expect(desk.get_by_text("last changed by olga")).to_be_visible()
    expect(desk.get_by_label("Reason")).to_have_value("pressed A without looking")
    desk.get_by_role("link", name="quickstart").click()
    expect(row).to_contain_text("excluded")

    desk.get_by_role("link", name="Audit").click()
    expect(desk.get_by_role("cell", name="person excluded")).to_be_visible()
    check(desk)
    assert complaints == []


@pytest.mark.parametrize("look", LOOKS)
def test_no_page_of_the_desk_has_barriers(server: ServerProcess, open_page: OpenPage, look: str) -> None:
    options: dict[str, Any] = LOOKS[look]
    page = open_page(**options)
    page.goto(f"{server.url}/desk/login")
    check(page)
    page.get_by_label("Name").fill("olga")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_role("heading", name="Studies")).to_be_visible()
    page.goto(f"{server.url}/desk/studies/quickstart")
    home = page.get_by_role("link", name="1", exact=True).get_attribute("href")
    places = ["", "studies/quickstart", "studies/quickstart/links", "studies/quickstart/export"]
    places += ["studies/quickstart/reports"]
    for place in [*places, "accounts", "tokens", "audit", "me"]:
        page.goto(f"{server.url}/desk/{place}")
        check(page)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), f"{place} is too wide"
    page.goto(f"{server.url}{home}")
    check(page)
    page.goto(f"{server.url}/desk/studies/quickstart/links")
    page.get_by_label("Ids, one a line").fill("ann\nbob")
    page.get_by_role("button", name="Make links").click()
    expect(page.get_by_role("heading", name="ann")).to_be_visible()
    check(page)
