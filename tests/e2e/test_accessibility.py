"""axe-core finds no barrier of WCAG 2.1, level A or AA, on any page: light on a large screen and dark on a phone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page

from app.settings import ROOT, find_study
from tests.e2e.conftest import OpenPage
from tests.support.server import ServerProcess, running_server
from tests.support.wayfarer import Wayfarer

pytestmark = pytest.mark.browser

STUDY = find_study("full-path")
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
LEVELS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
LOOKS: dict[str, dict[str, Any]] = {
    "light and wide": {"viewport": {"width": 1280, "height": 800}, "color_scheme": "light"},
    "dark on a phone": {
        "viewport": {"width": 360, "height": 780},
        "color_scheme": "dark",
        "has_touch": True,
        "is_mobile": True,
    },
}

# What is inside the stage's frame is pictures, and can't be reached.
_RUN = """async (levels) => {
  const found = await axe.run(document, { runOnly: levels, iframes: false, resultTypes: ["violations"] });
  const said = (node) => `${node.target.join(" ")} ${node.failureSummary}`;
  return found.violations.map(({ id, nodes }) => [id, nodes.map(said)]);
}"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server of the study that has every kind of step."""
    if not AXE.exists():
        pytest.skip("axe-core is not installed; `make node_modules/axe.stamp` does that")
    with running_server(tmp_path_factory.mktemp("accessibility"), STUDY.name) as started:
        yield started


@pytest.fixture
def somebody(server: ServerProcess) -> Iterator[Wayfarer]:
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        yield Wayfarer(client, STUDY)


def barriers(page: Page) -> list[Any]:
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found: list[Any] = page.evaluate(_RUN, LEVELS)
    return found


class Inspector:
    """Looks at pages in every look, and writes down the barriers."""

    def __init__(self, server: ServerProcess, open_page: OpenPage) -> None:
        self.server = server
        self.pages = {look: open_page(**options) for look, options in LOOKS.items()}
        self.found: dict[str, list[Any]] = {}

    def inspect(self, address: str, name: str) -> None:
        for look, page in self.pages.items():
            page.goto(self.server.url + address)
            self._note(f"{name}, {look}", page)
            if page.locator("form[data-keeps] [aria-required=true]").count():
                # Sent empty, it comes back with what is missing.
                page.locator("form[data-keeps] .begin").click()
                page.locator("#summary").wait_for()
                self._note(f"{name}, to mend, {look}", page)
            # A page that stays open follows the session by itself.
            page.goto("about:blank")

    def _note(self, name: str, page: Page) -> None:
        wrong = barriers(page)
        if wrong:
            self.found[name] = wrong


def test_no_page_along_the_path_has_a_barrier(
    server: ServerProcess, open_page: OpenPage, somebody: Wayfarer
) -> None:
    inspector, seen = Inspector(server, open_page), set()
    while (screen := somebody.screen())["kind"] != "finished":
        name = f"{screen['kind']} {screen['step']}"
        if name not in seen:
            inspector.inspect(somebody.home, name)
        seen.add(name)
        if name == "step 3" and "again" not in seen:
            seen.add("again")
            wrong = {"which-car": "orange"}
            somebody.send(somebody.form(**wrong))
            inspector.inspect(somebody.home, "again")
            assert somebody.send({**somebody.form(), "_tries": 1}).status_code == 303
            continue
        somebody.go_on()
    inspector.inspect(somebody.home, "completed")
    inspector.inspect(f"{somebody.home}leave", "deleting what is over")
    assert inspector.found == {}
    assert {"step 0", "question 4", "break 4", "step 9"} <= seen


def test_no_page_around_the_path_has_a_barrier(
    server: ServerProcess, open_page: OpenPage, somebody: Wayfarer
) -> None:
    inspector = Inspector(server, open_page)
    join = f"/join/{STUDY.name}"
    ways_out = ["leave", "leave?what=keep", "leave?what=delete", "device", "device?begin=1"]
    for address in (join, f"{join}/resume", "/s/nobody/", *(somebody.home + way for way in ways_out)):
        inspector.inspect(address, address)
    declined = somebody.send(somebody.form(accept="no"))
    assert declined.status_code == 303
    inspector.inspect(somebody.home, "declined")
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        other = Wayfarer(client, STUDY)
        other.go_on()
        assert other.send(other.form(**{"sees-animations": "no"})).status_code == 303
        inspector.inspect(other.home, "screened out")
    assert inspector.found == {}


def test_axe_would_see_a_barrier(server: ServerProcess, open_page: OpenPage, somebody: Wayfarer) -> None:
    page = open_page()
    page.goto(f"{server.url}/join/{STUDY.name}/resume")
    page.evaluate("() => document.querySelectorAll('label').forEach((label) => label.remove())")
    assert "label" in [rule for rule, _ in barriers(page)]
