"""A server that is killed or a network that is away under an open page: nothing is lost, nothing counts twice."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Route, expect

from tests.e2e.conftest import OpenPage
from tests.e2e.curves import assert_on_stage
from tests.e2e.person import N_QUERIES, WAIT_MS, Person, join
from tests.support.cable import cable_to
from tests.support.server import ServerProcess, running_server

pytestmark = pytest.mark.browser


@pytest.fixture
def mortal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server to be killed."""
    with running_server(tmp_path_factory.mktemp("mortal")) as started:
        yield started


def sees_connection_lost(person: Person) -> None:
    expect(person.page.locator("#notice")).to_contain_text("Connection lost", timeout=WAIT_MS)


def sees_connection_found(person: Person) -> None:
    expect(person.page.locator("#notice")).not_to_contain_text("Connection lost", timeout=WAIT_MS)


def sees_the_stored_query(person: Person, index: int) -> None:
    """Waits for a stage that the new server has filled, and checks what it shows."""

    def is_filled() -> bool:
        shown: bool = person.stage.evaluate(
            "() => [0, 1, 2, 3].some((name) => window.__viserMutable?.nodeRefFromName?.[`/${name}`])"
        )
        return shown and person.page.evaluate("() => !document.body.matches('.is-preparing')")

    for _ in range(WAIT_MS // 200):
        if is_filled():
            break
        person.page.wait_for_timeout(200)
    person.watches()
    assert_on_stage(person.watches_until(lambda seen: len(seen) > 3), person.query(index))


def finishes(person: Person) -> None:
    """Answers the third question and all after it; every answer is there once, in order."""
    for number in range(3, N_QUERIES + 1):
        person.sees_question(number)
        person.presses("b")
    person.sees_the_end()
    assert [answer["query_index"] for answer in person.answers()] == list(range(N_QUERIES))


@pytest.mark.slow
def test_an_open_page_outlives_the_server_and_the_session_is_finished(
    mortal: ServerProcess, open_page: OpenPage
) -> None:
    person = join(open_page(), mortal)
    person.sees_question(1)
    person.presses("a")
    person.sees_question(2)
    shown = person.query(1)

    mortal.kill()
    sees_connection_lost(person)
    mortal.restart()
    sees_connection_found(person)
    person.sees_question(2)
    assert person.query(1).controls_a.tolist() == shown.controls_a.tolist()
    sees_the_stored_query(person, 1)

    mortal.kill()
    person.clicks("second")
    expect(person.page.locator("#notice")).to_contain_text("Your answer will be sent", timeout=WAIT_MS)
    person.presses("a")
    mortal.restart()
    person.sees_question(3)
    assert person.positions() == ["first", "second"]
    sees_the_stored_query(person, 2)

    finishes(person)


AWAY_MS = 60_000


@pytest.mark.slow
@pytest.mark.parametrize("is_heard", [False, True], ids=["answer lost", "acknowledgement lost"])
def test_a_network_that_is_away_for_a_minute_in_the_middle_of_an_answer(
    server: ServerProcess, open_page: OpenPage, is_heard: bool
) -> None:
    with cable_to(server.port) as cable:
        person = join(open_page(), server, url=cable.url)
        person.sees_question(1)
        person.presses("a")
        person.sees_question(2)
        shown = person.query(1)
        if is_heard:
            cable.pull_after(b'"choice"')
        else:
            cable.pull()
        person.clicks("second")
        expect(person.page.locator("#notice")).to_contain_text("Your answer will be sent", timeout=WAIT_MS)
        assert cable.is_pulled
        known = ["first", "second"] if is_heard else ["first"]
        assert person.positions() == known
        person.page.wait_for_timeout(AWAY_MS)
        person.presses("a")
        assert person.positions() == known
        cable.plug_in()
        person.sees_question(3)
        sees_connection_found(person)
        assert person.positions() == ["first", "second"]
        assert person.query(1).controls_a.tolist() == shown.controls_a.tolist()
        sees_the_stored_query(person, 2)
        finishes(person)


def test_a_connection_that_says_nothing_is_taken_for_lost(server: ServerProcess, open_page: OpenPage) -> None:
    page = open_page()
    page.clock.install()
    held: list[Route] = []
    page.route("**/screens", lambda route: held.append(route))
    person = join(page, server)
    page.wait_for_timeout(1000)
    assert len(held) == 1
    page.clock.fast_forward(39_000)
    page.wait_for_timeout(100)
    assert len(held) == 1
    page.clock.fast_forward(10_000)
    for _ in range(WAIT_MS // 200):
        if len(held) == 2:
            break
        page.wait_for_timeout(200)
    assert len(held) == 2
    page.unroute_all(behavior="ignoreErrors")
    sees_connection_found(person)
    person.sees_question(1)


@pytest.mark.slow
def test_a_session_that_the_server_no_longer_knows_says_so(
    mortal: ServerProcess, open_page: OpenPage
) -> None:
    person = join(open_page(), mortal)
    person.sees_question(1)
    mortal.kill()
    (mortal.folder / "serve.db").unlink()
    mortal.restart()
    expect(person.page.get_by_text("This link doesn’t open a session here")).to_be_visible(timeout=WAIT_MS)
