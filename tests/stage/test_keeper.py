"""Who gets a stage for how long, and what a page may ask of it."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from app.stage.framing import Layout
from app.stage.keeper import Action, InvalidActionError, StageKeeper
from app.stage.stage import Picture, StageBusyError
from study_core.scene import Scene
from tests.stage.watching import clips, wait_until


@pytest.fixture
def keeper(picture: Picture) -> Iterator[StageKeeper]:
    keeper = StageKeeper(lambda _: picture, capacity=2, idle_s=0.2)
    yield keeper
    keeper.close()


def test_a_session_has_one_stage_for_all_its_viewers(keeper: StageKeeper, picture: Picture) -> None:
    stage = keeper.enter("ann")
    assert keeper.enter("ann") is stage
    assert keeper.n_viewers("ann") == 2
    assert stage.picture == picture
    assert keeper.enter("bob") is not stage


def test_the_last_viewer_to_leave_closes_the_stage_after_a_while(keeper: StageKeeper) -> None:
    stage = keeper.enter("ann")
    keeper.enter("ann")
    keeper.leave("ann")
    time.sleep(0.3)
    assert keeper.find("ann") is stage
    keeper.leave("ann")
    assert keeper.find("ann") is stage
    wait_until(lambda: keeper.find("ann") is None)


def test_coming_back_in_time_finds_the_same_stage(keeper: StageKeeper) -> None:
    stage = keeper.enter("ann")
    keeper.leave("ann")
    assert keeper.enter("ann") is stage
    time.sleep(0.4)
    assert keeper.find("ann") is stage


def test_coming_back_too_late_builds_the_stage_anew_from_the_session(keeper: StageKeeper) -> None:
    stage = keeper.enter("ann")
    keeper.leave("ann")
    wait_until(lambda: keeper.find("ann") is None)
    again = keeper.enter("ann")
    assert again is not stage
    assert again.picture is not None


def test_a_full_house_turns_people_away(keeper: StageKeeper) -> None:
    keeper.enter("ann")
    keeper.enter("bob")
    with pytest.raises(StageBusyError, match="All 2 stages are in use"):
        keeper.enter("cat")
    assert len(keeper) == 2


def test_a_stage_that_nobody_watches_makes_room(keeper: StageKeeper) -> None:
    keeper.enter("ann")
    keeper.enter("bob")
    keeper.leave("ann")
    keeper.enter("cat")
    assert keeper.find("ann") is None
    assert keeper.find("bob") is not None


def test_refreshing_shows_a_new_query_but_does_not_restart_the_same_one(scenes: tuple[Scene, Scene]) -> None:
    current = [Picture("0", *scenes)]
    keeper = StageKeeper(lambda _: current[0])
    try:
        stage = keeper.enter("ann")
        before = clips(stage)
        keeper.refresh("ann")
        assert clips(stage) == before
        current[0] = Picture("1", *reversed(scenes))
        keeper.refresh("ann")
        assert clips(stage)[:-1] == before
        keeper.refresh("nobody")
    finally:
        keeper.close()


def test_a_layout_asked_for_before_the_stage_exists_is_remembered(keeper: StageKeeper) -> None:
    assert keeper.perform("ann", Action.TALL)
    assert not keeper.perform("ann", Action.REPLAY)
    stage = keeper.enter("ann")
    assert stage.layout is Layout.TALL
    assert keeper.perform("ann", Action.PAUSE)
    assert stage.is_paused
    assert keeper.perform("ann", Action.RESUME)
    assert not stage.is_paused


def test_a_page_may_seek_and_choose_one_of_three_speeds(keeper: StageKeeper) -> None:
    assert not keeper.perform("ann", Action.SEEK, 1.0)
    keeper.enter("ann")
    assert keeper.perform("ann", Action.PAUSE)
    assert keeper.perform("ann", Action.SEEK, 1.0)
    assert keeper.perform("ann", Action.SPEED, 0.5)
    playing = keeper.playing("ann")
    assert playing is not None
    assert (playing.position_s, playing.speed, playing.is_paused) == (1.0, 0.5, True)


@pytest.mark.parametrize(
    ("action", "value"),
    [
        (Action.SPEED, 3.0),
        (Action.SPEED, None),
        (Action.SEEK, None),
        (Action.SEEK, -0.1),
        (Action.SEEK, float("nan")),
        (Action.SEEN, -1.0),
        (Action.SEEN, 8.0),
        (Action.SEEN, 1.5),
        (Action.SEEN, None),
        (Action.REPLAY, 1.0),
    ],
)
def test_a_value_that_no_page_would_send_is_refused(
    keeper: StageKeeper, action: Action, value: float | None
) -> None:
    keeper.enter("ann")
    with pytest.raises(InvalidActionError):
        keeper.perform("ann", action, value)


def test_a_wish_to_see_no_motion_is_remembered_like_a_layout(keeper: StageKeeper) -> None:
    assert keeper.perform("ann", Action.STILL)
    assert keeper.perform("ann", Action.TALL)
    stage = keeper.enter("ann")
    assert (stage.layout, stage.is_paused) == (Layout.TALL, True)
    assert keeper.perform("ann", Action.MOVING)
    assert not stage.is_paused


def test_a_full_house_has_room_for_who_is_in_or_when_somebody_leaves(keeper: StageKeeper) -> None:
    keeper.enter("ann")
    assert keeper.has_room("cat")
    keeper.enter("bob")
    assert keeper.has_room("bob")
    assert not keeper.has_room("cat")
    keeper.leave("ann")
    assert keeper.has_room("cat")


def test_nothing_is_shown_while_there_is_no_picture() -> None:
    keeper = StageKeeper(lambda _: None)
    try:
        stage = keeper.enter("ann")
        stage.replay()
        stage.pause()
        assert clips(stage) == []
    finally:
        keeper.close()
