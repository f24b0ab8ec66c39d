"""A real server and a real browser; software rendering is slow, so windows are small and waits are generous."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, Playwright, sync_playwright

from tests.e2e.person import Person, join
from tests.support.server import ServerProcess, running_server

WAIT_MS = 90_000

FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    # As Chromium decides by itself where there is no graphics card: only WebGL is left to the software renderer.
    "--disable-gpu-compositing",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--disable-quic",
)

Launch = Callable[..., Browser]
OpenPage = Callable[..., Page]


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """One server for every test that doesn't harm it."""
    with running_server(tmp_path_factory.mktemp("e2e")) as started:
        yield started


# Not for the whole session: while playwright runs, no other test of the same process may run an event loop.
@pytest.fixture(scope="module")
def playwright() -> Iterator[Playwright]:
    with sync_playwright() as started:
        yield started


@pytest.fixture(scope="module")
def launch(playwright: Playwright) -> Launch:
    """Starts a Chromium with more flags than usual."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("Chromium is not installed; `make chromium` does that")

    def start(*more: str) -> Browser:
        return playwright.chromium.launch(executable_path=chromium, args=[*FLAGS, *more])

    return start


@pytest.fixture(scope="module")
def browser(launch: Launch) -> Iterator[Browser]:
    started = launch()
    yield started
    started.close()


@pytest.fixture
def open_page(browser: Browser) -> Iterator[OpenPage]:
    """Opens an empty page as a new visitor would: with cookies of its own."""
    contexts = []

    def visit(**options: object) -> Page:
        context = browser.new_context(**{"viewport": {"width": 640, "height": 420}, **options})
        context.set_default_timeout(WAIT_MS)
        contexts.append(context)
        return context.new_page()

    yield visit
    for context in contexts:
        context.close()


@pytest.fixture
def person(server: ServerProcess, open_page: OpenPage) -> Person:
    """Somebody who has just begun the quickstart study."""
    return join(open_page(), server)
