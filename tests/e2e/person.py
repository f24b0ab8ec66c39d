"""A participant at a browser, and what they can be seen to see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from playwright.sync_api import ConsoleMessage, Error, Frame, Page, expect

from app.services.tokens import hash_token
from app.settings import find_study
from app.store import EventRecord, SessionRecord, Store, open_store
from study_core import session_codec
from study_core.comparison import Choice, Query
from study_core.events import QueryPrepared
from tests.support.server import ServerProcess

STUDY = find_study("quickstart")
N_QUERIES = STUDY.n_queries
WAIT_MS = 90_000
POSITIONS = ("first", "second")

# Writes down, at each frame of the stage, where the cars are seen: [robot A, human A, robot B, human B], each from
# -1 at the left and bottom of the picture to 1. `__viserMutable` is viser's own affair: good enough to look at.
_RECORD = """() => {
  if (window.seen) return;
  window.seen = [];
  const look = () => {
    const viser = window.__viserMutable;
    const clips = [0, 1, 2, 3].map((name) => viser?.nodeRefFromName?.[`/${name}`]).filter(Boolean);
    const found = [];
    // The nearest clip that has loaded hides the others.
    for (const clip of clips.sort((one, other) => other.position.z - one.position.z)) {
      const cars = [];
      clip.traverse((node) => {
        if (!/^(robot|human)_car/.test(node.name)) return;
        node.updateWorldMatrix(true, false);
        const seen = node.position.clone().setFromMatrixPosition(node.matrixWorld).project(viser.camera);
        cars.push([seen.x, seen.y]);
      });
      if (cars.length === 4) found.push(cars);
    }
    if (found.length > 0) window.seen.push(found[0]);
    requestAnimationFrame(look);
  };
  look();
}"""

Seen = list[list[float]]
"""Where the four cars were in one frame."""


@dataclass
class Person:
    """Somebody at a page of the study.

    Attributes:
        page: Their page.
        server: What it talks to.
        problems: Errors in the browser that shouldn't be there.
    """

    page: Page
    server: ServerProcess
    problems: list[str] = field(default_factory=list)

    @property
    def token(self) -> str:
        """The secret in the page's address."""
        return self.page.url.rstrip("/").rsplit("/", 1)[-1]

    def sees_question(self, number: int) -> None:
        """Waits until a question can be answered."""
        expect(self.page.locator("#count")).to_have_text(f"Question {number} of {N_QUERIES}", timeout=WAIT_MS)
        for position in POSITIONS:
            expect(self.page.locator(f"#answer-{position}")).to_be_enabled(timeout=WAIT_MS)

    def sees_the_end(self) -> None:
        """Waits for the last page."""
        expect(self.page.get_by_role("heading", name="All done")).to_be_visible(timeout=WAIT_MS)

    def clicks(self, position: str) -> None:
        """Answers with the mouse."""
        self.page.locator(f"#answer-{position}").click()

    def presses(self, key: str) -> None:
        """Presses a key, wherever the focus is."""
        self.page.keyboard.press(key)

    @property
    def stage(self) -> Frame:
        """The frame in which the cars drive."""
        frame = self.page.locator("#stage").element_handle().content_frame()
        assert frame is not None
        return frame

    def watches(self) -> None:
        """Begins to write down what the stage shows, or begins anew."""
        self.stage.evaluate(_RECORD)
        self.stage.evaluate("() => { window.seen.length = 0 }")

    def saw(self) -> list[Seen]:
        """Returns what the stage has shown since."""
        seen: list[Seen] = self.stage.evaluate("() => window.seen")
        return seen

    def watches_until(self, is_enough: Callable[[list[Seen]], bool]) -> list[Seen]:
        """Watches until what has been seen is enough, and returns it."""
        for _ in range(WAIT_MS // 200):
            seen = self.saw()
            if is_enough(seen):
                return seen
            self.page.wait_for_timeout(200)
        raise AssertionError(f"not seen in {WAIT_MS // 1000} s; the last of {len(seen)} frames: {seen[-3:]}")

    def stored(self) -> tuple[SessionRecord, tuple[EventRecord, ...]]:
        """Returns the session and its log as the database has them."""
        with open_store(self.server.database) as store:
            record = self.session_in(store)
            return record, store.events(record.id)

    def session_in(self, store: Store) -> SessionRecord:
        """Returns the session of this page."""
        record = store.session_by_token(hash_token(self.token))
        assert record is not None
        return record

    def answers(self) -> list[dict[str, Any]]:
        """Returns the stored answers in order."""
        return [event.payload for event in self.stored()[1] if event.kind == "answer_given"]

    def positions(self) -> list[str]:
        """Returns where on the screen the stored answers were given, in order."""
        first = [event.first_shown for event in self._prepared()]
        return [POSITIONS[answer["choice"] != first[answer["query_index"]]] for answer in self.answers()]

    def query(self, index: int) -> Query:
        """Returns a query as the database has it, with what is shown first as its A."""
        event = self._prepared()[index]
        query = event.proposed.query
        if event.first_shown is Choice.B:
            return replace(query, controls_a=query.controls_b, controls_b=query.controls_a)
        return query

    def _prepared(self) -> list[QueryPrepared]:
        events = (session_codec.from_json(event.kind, event.payload) for event in self.stored()[1])
        return [event for event in events if isinstance(event, QueryPrepared)]


def join(page: Page, server: ServerProcess, study_name: str = STUDY.name, url: str | None = None) -> Person:
    """Follows the participant link and begins; `url` is where the server is reached, if not where it listens."""
    page.goto(f"{url or server.url}/join/{study_name}")
    page.get_by_role("button", name="Begin").click()
    page.wait_for_url("**/s/*/")
    return at(page, server)


def at(page: Page, server: ServerProcess) -> Person:
    """Returns the person at a page, with an eye on its errors."""
    person = Person(page, server)
    page.on("pageerror", lambda error: person.problems.extend(_problem_in(error)))
    page.on("console", lambda message: person.problems.extend(_problem_said(message)))
    return person


def _problem_in(error: Error) -> list[str]:
    # viser's client would like to load a decoder and a picture of the sky from `data:` addresses; it may not, and
    # does without.
    is_visers = error.message == "Failed to fetch" and "/static/js/" not in (error.stack or "")
    return [] if is_visers else [f"{error.message} {error.stack}"]


def _problem_said(message: ConsoleMessage) -> list[str]:
    harmless = ("Connecting to 'data:", "Fetch API cannot load data:", "Failed to load HDR JPEG")
    return [message.text] if message.type == "error" and not message.text.startswith(harmless) else []
