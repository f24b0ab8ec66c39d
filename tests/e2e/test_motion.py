"""The cars drive what the database says, and stop when they are told to."""

from __future__ import annotations

import numpy as np
import pytest

from app.stage.framing import Layout
from tests.e2e.conftest import OpenPage
from tests.e2e.curves import NEAR, assert_on_stage, curves, in_picture, moments
from tests.e2e.person import Person, Seen, join
from tests.support.server import ServerProcess

pytestmark = pytest.mark.browser

LONGER_THAN_THE_HOLDS_MS = 2500


def spans(seen: list[Seen], person: Person, index: int, layout: Layout = Layout.WIDE) -> float:
    """Which part of the drive has been seen."""
    found = moments(seen, person.query(index), layout)
    return float(np.ptp(found)) if len(found) else 0.0


def reaches(person: Person, moment: float) -> float:
    """Waits until the drive is about there, between a moment and three fifths; returns where it is."""

    def is_there(seen: list[Seen]) -> bool:
        return bool(seen) and moment < moments(seen[-1:], query)[0] < 0.6

    query = person.query(0)
    person.watches()
    return float(moments(person.watches_until(is_there)[-1:], query)[0])


def stands_still(person: Person) -> float:
    """Waits until nothing has moved for longer than a playing clip ever holds; returns where it is."""
    for _ in range(20):
        person.watches()
        person.page.wait_for_timeout(LONGER_THAN_THE_HOLDS_MS)
        seen = np.array(person.saw())
        if len(seen) > 1 and np.ptp(seen, axis=0).max() < 1e-6:
            return float(moments(person.saw()[-1:], person.query(0))[0])
    raise AssertionError("the cars never stood still")


def moves_off(person: Person, from_moment: float) -> float:
    """Waits until the cars have left a moment; returns where they are first seen elsewhere."""

    def elsewhere(seen: list[Seen]) -> list[float]:
        return [float(moment) for moment in moments(seen, query) if abs(moment - from_moment) > 0.01]

    query = person.query(0)
    return elsewhere(person.watches_until(lambda seen: len(elsewhere(seen)) > 0))[0]


def test_both_sides_drive_along_the_trajectories_of_the_stored_query(person: Person) -> None:
    person.sees_question(1)
    query = person.query(0)
    person.watches()
    seen = person.watches_until(lambda seen: spans(seen, person, 0) > 0.7)
    assert_on_stage(seen, query)
    # Time goes forwards, except when the loop begins again.
    steps = np.diff(moments(seen, query))
    assert all(step > -1e-6 or step < -0.5 for step in steps)
    robots = in_picture(seen, Layout.WIDE)[:, [0, 2]]
    apart = np.linalg.norm(robots[:, 0] - robots[:, 1] - (0.0, 1.0), axis=1)
    assert apart.max() > 2 * NEAR
    assert np.ptp(robots, axis=0).max() > 0.1


def test_two_people_see_their_own_queries_only(server: ServerProcess, open_page: OpenPage) -> None:
    people = [join(open_page(), server) for _ in range(2)]
    for person in people:
        person.sees_question(1)
        person.watches()
    for person in people:
        seen = person.watches_until(lambda seen, person=person: spans(seen, person, 0) > 0.5)  # type: ignore[misc]
        assert_on_stage(seen, person.query(0))
    one, two = (person.query(0) for person in people)
    assert not np.allclose(one.controls_a, two.controls_a)
    ways = [curves(query, Layout.WIDE)[0].points for query in (one, two)]
    assert np.abs(ways[0] - ways[1]).max() > 2 * NEAR


def test_pause_stops_the_cars_and_play_goes_on_from_there(person: Person) -> None:
    person.sees_question(1)
    reaches(person, 0.2)
    person.page.get_by_role("button", name="Pause", exact=True).click()
    paused_at = stands_still(person)
    assert 0.2 < paused_at < 1.0
    person.watches()
    person.page.get_by_role("button", name="Play", exact=True).click()
    assert moves_off(person, paused_at) > paused_at - 0.1


def test_replay_starts_the_paused_cars_from_the_beginning(person: Person) -> None:
    person.sees_question(1)
    reaches(person, 0.3)
    person.page.get_by_role("button", name="Pause", exact=True).click()
    paused_at = stands_still(person)
    person.watches()
    person.page.get_by_role("button", name="Replay", exact=True).click()
    assert moves_off(person, paused_at) < 0.15
    assert person.page.get_by_role("button", name="Pause", exact=True).is_visible()


def test_space_pauses_and_r_replays(person: Person) -> None:
    person.sees_question(1)
    reaches(person, 0.3)
    person.presses(" ")
    paused_at = stands_still(person)
    person.watches()
    person.presses("r")
    assert moves_off(person, paused_at) < 0.15
    reaches(person, 0.2)
    person.presses(" ")
    paused_at = stands_still(person)
    person.watches()
    person.presses(" ")
    assert moves_off(person, paused_at) > paused_at - 0.1


def test_a_page_that_is_reloaded_while_paused_plays(person: Person) -> None:
    person.sees_question(1)
    person.presses(" ")
    stands_still(person)
    person.page.reload()
    person.sees_question(1)
    person.watches()
    assert person.page.get_by_role("button", name="Pause", exact=True).is_visible()
    assert_on_stage(person.watches_until(lambda seen: spans(seen, person, 0) > 0.3), person.query(0))
