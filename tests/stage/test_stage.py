"""The order of what a stage tells its viser server."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from app.stage.clip import N_FLAGS, TAIL_S, build_clip, duration_s
from app.stage.framing import Layout
from app.stage.stage import APPEARS_S, TELLS_S, Picture, Stage, StageClosedError
from study_core.scene import Scene
from tests.stage.made_up import drive
from tests.stage.watching import clips, wait_until


class Clock:
    """A clock that goes on when told."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def stage(clock: Clock) -> Iterator[Stage]:
    stage = Stage(clock=clock)
    yield stage
    stage.close()


def shows(
    stage: Stage,
    picture: Picture,
    start_s: float = 0.0,
    frozen: bool = False,
    layout: Layout = Layout.WIDE,
    **how: float,
) -> bool:
    """Whether the nearest clip is this one, whatever its flag."""
    data = clips(stage)[-1]
    a, b, number = picture.a, picture.b, picture.number
    return any(
        data == build_clip(a, b, layout, start_s, frozen, mark=number, flag=flag, **how)
        for flag in range(N_FLAGS)
    )


def swapped(picture: Picture) -> Picture:
    """The next query."""
    return Picture("1", picture.b, picture.a, 1)


def test_a_new_picture_hides_the_old_one_until_a_page_sees_it_and_then_takes_its_place(
    stage: Stage, picture: Picture
) -> None:
    stage.show(picture)
    old = clips(stage)
    stage.show(swapped(picture))
    assert clips(stage)[:-1] == old
    assert shows(stage, swapped(picture))
    for other in set(range(N_FLAGS)) - {stage._flag}:
        stage.see(other)
    assert len(clips(stage)) == 2
    stage.see(stage._flag)
    assert len(clips(stage)) == 1
    assert shows(stage, swapped(picture))


def test_what_is_hidden_goes_in_a_while_even_if_no_page_can_see(
    stage: Stage, picture: Picture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.stage.stage.SEEN_AT_LATEST_S", 0.2)
    stage.show(picture)
    stage.show(swapped(picture))
    assert len(clips(stage)) == 2
    wait_until(lambda: len(clips(stage)) == 1)
    assert shows(stage, swapped(picture))


def test_a_flag_that_comes_late_removes_nothing(stage: Stage, picture: Picture) -> None:
    stage.show(picture)
    stage.replay()
    late = stage._flag
    stage.show(swapped(picture))
    stage.see(late)
    assert len(clips(stage)) == 3


def test_how_long_a_clip_takes_to_appear_is_learned_from_the_page(
    stage: Stage, picture: Picture, clock: Clock
) -> None:
    stage.show(picture)
    clock.now += 2.0
    stage.replay()
    clock.now += 0.08 + TELLS_S
    stage.see(stage._flag)
    clock.now += 1.0
    stage.pause()
    assert stage.playing is not None
    assert stage.playing.position_s == pytest.approx(TELLS_S + 1.0 + 0.08)


def test_the_first_clip_runs_from_when_it_is_seen(stage: Stage, picture: Picture, clock: Clock) -> None:
    stage.show(picture)
    clock.now += 30.0
    stage.see(stage._flag)
    clock.now += 1.0
    stage.see(stage._flag)
    assert stage.playing is not None
    assert stage.playing.position_s == pytest.approx(TELLS_S + 1.0)
    stage.pause()
    assert stage.playing.position_s == pytest.approx(TELLS_S + 1.0 + APPEARS_S)


def test_of_many_changes_at_once_only_the_last_three_are_kept(
    stage: Stage, scenes: tuple[Scene, Scene]
) -> None:
    for index in range(6):
        stage.show(Picture(str(index), *scenes))
        stage.replay()
        assert len(clips(stage)) <= 3
    last = Picture("9", drive(0.05), drive(-0.05), 9)
    stage.show(last)
    assert shows(stage, last)
    assert len(clips(stage)) == 3
    stage.see(stage._flag)
    assert len(clips(stage)) == 1
    assert shows(stage, last)


def test_pause_shows_the_moment_at_which_the_still_picture_appears(
    stage: Stage, picture: Picture, clock: Clock
) -> None:
    stage.show(picture)
    clock.now += 2.0
    stage.pause()
    assert shows(stage, picture, 2.0 + APPEARS_S, frozen=True)
    assert stage.is_paused


def test_resume_goes_on_from_the_paused_moment(stage: Stage, picture: Picture, clock: Clock) -> None:
    stage.show(picture)
    clock.now += 2.0
    stage.pause()
    clock.now += 30.0
    stage.resume()
    assert shows(stage, picture, 2.0 + APPEARS_S)
    assert not stage.is_paused


def test_pause_finds_its_place_after_several_loops(stage: Stage, picture: Picture, clock: Clock) -> None:
    stage.show(picture)
    clock.now += 3 * duration_s(picture.a, picture.b) + 1.0
    stage.pause()
    assert stage._play.start_s == pytest.approx(1.0 + APPEARS_S)


def test_another_speed_goes_on_from_the_place_and_holds_for_the_next_picture(
    stage: Stage, picture: Picture, clock: Clock
) -> None:
    stage.show(picture)
    clock.now += 2.0
    stage.set_speed(2.0)
    # The old clip plays on for APPEARS_S.
    start_s = 2.0 + APPEARS_S
    assert shows(stage, picture, start_s, speed=2.0)
    clock.now += 1.0
    assert stage.playing is not None
    assert stage.playing.position_s == pytest.approx(start_s + 2.0)
    stage.pause()
    assert shows(stage, picture, start_s + 2.0 + 2.0 * APPEARS_S, frozen=True)
    stage.show(swapped(picture))
    assert shows(stage, swapped(picture), speed=2.0)


def test_seeking_keeps_a_still_picture_still_and_a_playing_one_playing(
    stage: Stage, picture: Picture
) -> None:
    stage.show(picture)
    stage.seek(3.0)
    assert shows(stage, picture, 3.0)
    stage.seek(0.04)
    assert shows(stage, picture, 0.04)
    stage.pause()
    stage.seek(4.5)
    assert shows(stage, picture, 4.5, frozen=True)
    assert stage.playing is not None
    assert (stage.playing.position_s, stage.playing.is_paused) == (4.5, True)


def test_the_end_of_the_loop_is_not_its_beginning(stage: Stage, picture: Picture) -> None:
    stage.show(picture)
    stage.pause()
    stage.seek(duration_s(picture.a, picture.b))
    assert stage.playing is not None
    assert stage.playing.position_s == pytest.approx(stage.playing.duration_s, abs=0.01)


def test_whoever_wants_no_motion_sees_first_moments_until_they_press_play(
    stage: Stage, picture: Picture
) -> None:
    stage.set_still(True)
    stage.show(picture)
    assert shows(stage, picture, frozen=True)
    stage.resume()
    assert shows(stage, picture)
    stage.show(swapped(picture))
    assert shows(stage, swapped(picture), frozen=True)


def test_a_stage_tells_where_both_drives_end(stage: Stage, picture: Picture) -> None:
    assert stage.playing is None
    stage.show(picture)
    assert stage.playing is not None
    assert stage.playing.duration_s == duration_s(picture.a, picture.b)
    assert stage.playing.end_s == stage.playing.duration_s - TAIL_S


def test_another_layout_keeps_the_place_and_comes_at_once(
    stage: Stage, picture: Picture, clock: Clock
) -> None:
    stage.show(picture)
    clock.now += 1.5
    stage.set_layout(Layout.TALL)
    assert shows(stage, picture, 1.5, layout=Layout.TALL)
    assert len(clips(stage)) == 1


def test_a_new_picture_plays_even_if_the_last_was_paused(stage: Stage, picture: Picture) -> None:
    stage.show(picture)
    stage.pause()
    stage.show(swapped(picture))
    assert not stage.is_paused


def test_a_stage_listens_on_this_machine_only_and_closes_its_port(picture: Picture) -> None:
    stage = Stage()
    assert stage._server.get_host() == "127.0.0.1"
    with socket.create_connection(("127.0.0.1", stage.port), timeout=5):
        pass
    stage.close()
    stage.close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", stage.port), timeout=5)
    with pytest.raises(StageClosedError):
        stage.show(picture)
