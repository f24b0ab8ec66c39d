"""Keeps the stages of all participants who are here: built on arrival, closed a while after they leave."""

from __future__ import annotations

import asyncio
import threading
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from enum import Enum

from app.errors import AppError
from app.stage.clip import N_FLAGS
from app.stage.framing import Layout
from app.stage.stage import Picture, Playing, Stage, StageBusyError

_WISHES_REMEMBERED = 10_000


class Action(Enum):
    """What a participant's page may ask of its stage; each member's value is its name on the wire."""

    REPLAY = "replay"
    PAUSE = "pause"
    RESUME = "resume"
    SEEK = "seek"
    """To a place in the loop, in seconds."""
    SPEED = "speed"
    """In seconds of the loop per second."""
    SEEN = "seen"
    """The clip whose flag is the value is on the screen."""
    WIDE = "wide"
    TALL = "tall"
    STILL = "still"
    """Nothing moves until it is told to play."""
    MOVING = "moving"


_SPEEDS = (0.5, 1.0, 2.0)
_LATEST_S = 3600.0


class InvalidActionError(AppError):
    """An action whose value can't be one."""


@dataclass(frozen=True)
class _Wishes:
    """How a page wants its stage, whatever it shows."""

    layout: Layout = Layout.WIDE
    is_still: bool = False

    def with_(self, action: Action) -> _Wishes:
        if action in (Action.STILL, Action.MOVING):
            return replace(self, is_still=action is Action.STILL)
        return replace(self, layout=Layout(action.value))

    def fulfil(self, stage: Stage) -> None:
        stage.set_layout(self.layout)
        stage.set_still(self.is_still)


_WISHED = (Action.WIDE, Action.TALL, Action.STILL, Action.MOVING)


@dataclass
class _Seat:
    stage: Stage
    n_viewers: int = 0
    farewell: threading.Timer | None = None


class StageKeeper:
    """Stages by session.

    Every method may be called from any thread. `enter`, `refresh` and `close` may take some milliseconds (a
    viser server starts or stops, the picture is fetched), so call them from a worker thread, or use `visit`,
    which does.
    """

    def __init__(
        self, picture_for: Callable[[str], Picture | None], capacity: int = 200, idle_s: float = 60.0
    ) -> None:
        """Holds no stage yet.

        Args:
            picture_for: Tells what a session's participant should see now, or nothing; called from worker
                threads, whenever a stage is built or refreshed.
            capacity: Most stages at a time.
            idle_s: How long a stage outlives its last viewer, so that a reload finds it.
        """
        self._picture_for = picture_for
        self._capacity = capacity
        self._idle_s = idle_s
        self._seats: dict[str, _Seat] = {}
        # A page tells its layout before its scene connects, so the wish may come before the stage.
        self._wishes: OrderedDict[str, _Wishes] = OrderedDict()
        self._lock = threading.RLock()

    def enter(self, session_id: str) -> Stage:
        """Counts a viewer in and returns the stage, built if need be.

        Raises:
            StageBusyError: Every stage is taken and watched.
        """
        with self._lock:
            seat = self._seats.get(session_id) or self._seat(session_id)
            if seat.farewell is not None:
                seat.farewell.cancel()
                seat.farewell = None
            seat.n_viewers += 1
            stage = seat.stage
        self._refresh(stage, session_id)
        return stage

    def leave(self, session_id: str) -> None:
        """Counts a viewer out; the last one's stage is closed when it has been idle for long enough."""
        with self._lock:
            seat = self._seats.get(session_id)
            if seat is None:
                return
            seat.n_viewers -= 1
            if seat.n_viewers <= 0:
                seat.farewell = threading.Timer(self._idle_s, self._close_if_idle, (session_id, seat))
                seat.farewell.daemon = True
                seat.farewell.start()

    @asynccontextmanager
    async def visit(self, session_id: str) -> AsyncIterator[Stage]:
        """Enters for as long as the block runs, without ever blocking the event loop.

        Raises:
            StageBusyError: Every stage is taken and watched.
        """
        stage = await asyncio.to_thread(self.enter, session_id)
        try:
            yield stage
        finally:
            # Shielded: a cancelled request must still be counted out.
            await asyncio.shield(asyncio.to_thread(self.leave, session_id))

    def find(self, session_id: str) -> Stage | None:
        """The session's stage, if it has one now."""
        with self._lock:
            seat = self._seats.get(session_id)
            return seat.stage if seat is not None else None

    def refresh(self, session_id: str) -> None:
        """Shows the session's current picture if its stage is open and shows another one."""
        stage = self.find(session_id)
        if stage is not None:
            self._refresh(stage, session_id)

    def forget(self, session_id: str) -> None:
        """Closes a session's stage at once, whoever watches, with the pictures that it holds."""
        with self._lock:
            self._wishes.pop(session_id, None)
            if session_id in self._seats:
                self._drop(session_id)

    def perform(self, session_id: str, action: Action, value: float | None = None) -> bool:
        """Does what a page asks.

        Args:
            session_id: Whose page.
            action: What it asks.
            value: For `seek` the place in the loop in seconds, for `speed` 0.5, 1 or 2, for `seen` the flag.

        Returns:
            Whether it could be done: without a stage, only the layout and the wish to start still can be noted,
            for when there is one.

        Raises:
            InvalidActionError: The value can't be one of this action.
        """
        _check(action, value)
        if action in _WISHED:
            self._note(session_id, action)
            return True
        stage = self.find(session_id)
        if stage is None:
            return False
        _DEEDS[action](stage, value or 0.0)
        return True

    def playing(self, session_id: str) -> Playing | None:
        """How a session's clip plays, if it has a stage with one."""
        stage = self.find(session_id)
        return None if stage is None else stage.playing

    def has_room(self, session_id: str) -> bool:
        """Whether a session has a stage or could get one now."""
        with self._lock:
            return (
                session_id in self._seats
                or len(self._seats) < self._capacity
                or any(seat.n_viewers <= 0 for seat in self._seats.values())
            )

    def n_viewers(self, session_id: str) -> int:
        """How many browser pages are watching this session's stage."""
        # Without the lock, which is held while a stage is built: the web's event loop asks this.
        seat = self._seats.get(session_id)
        return seat.n_viewers if seat is not None else 0

    def close(self) -> None:
        """Closes every stage."""
        with self._lock:
            seats = list(self._seats.values())
            self._seats.clear()
        for seat in seats:
            if seat.farewell is not None:
                seat.farewell.cancel()
            seat.stage.close()

    def __len__(self) -> int:
        """Number of open stages."""
        return len(self._seats)

    def _note(self, session_id: str, action: Action) -> None:
        with self._lock:
            wishes = self._wishes.pop(session_id, _Wishes()).with_(action)
            self._wishes[session_id] = wishes
            while len(self._wishes) > _WISHES_REMEMBERED:
                self._wishes.popitem(last=False)
        stage = self.find(session_id)
        if stage is not None:
            wishes.fulfil(stage)

    def _refresh(self, stage: Stage, session_id: str) -> None:
        picture = self._picture_for(session_id)
        if picture is None:
            return
        shown = stage.picture
        if shown is None or shown.key != picture.key:
            stage.show(picture)

    def _seat(self, session_id: str) -> _Seat:
        """Builds a stage; at capacity, the one that was left first makes room."""
        if len(self._seats) >= self._capacity:
            idle = next((name for name, seat in self._seats.items() if seat.n_viewers <= 0), None)
            if idle is None:
                raise StageBusyError(self._capacity)
            self._drop(idle)
        seat = self._seats[session_id] = _Seat(Stage())
        self._wishes.get(session_id, _Wishes()).fulfil(seat.stage)
        return seat

    def _close_if_idle(self, session_id: str, seat: _Seat) -> None:
        with self._lock:
            is_idle = self._seats.get(session_id) is seat and seat.n_viewers <= 0
            if is_idle:
                self._drop(session_id)

    def _drop(self, session_id: str) -> None:
        seat = self._seats.pop(session_id)
        if seat.farewell is not None:
            seat.farewell.cancel()
        # Stopping a viser server may take a second; nobody has to wait for it.
        threading.Thread(target=seat.stage.close, name="stage-close", daemon=True).start()


_DEEDS: dict[Action, Callable[[Stage, float], None]] = {
    Action.REPLAY: lambda stage, _: stage.replay(),
    Action.PAUSE: lambda stage, _: stage.pause(),
    Action.RESUME: lambda stage, _: stage.resume(),
    Action.SEEK: lambda stage, position_s: stage.seek(position_s),
    Action.SPEED: lambda stage, speed: stage.set_speed(speed),
    Action.SEEN: lambda stage, flag: stage.see(int(flag)),
}


def _check(action: Action, value: float | None) -> None:
    if action is Action.SPEED:
        if value not in _SPEEDS:
            raise InvalidActionError(f"Expected the speed 0.5, 1 or 2, got {value}.")
    elif action is Action.SEEK:
        if value is None or not 0.0 <= value <= _LATEST_S:
            raise InvalidActionError(f"Expected a place in the loop from 0 to {_LATEST_S:g} s, got {value}.")
    elif action is Action.SEEN:
        if value not in range(N_FLAGS):
            raise InvalidActionError(f"Expected a flag from 0 to {N_FLAGS - 1}, got {value}.")
    elif value is not None:
        raise InvalidActionError(f"Expected no value with '{action.value}', got {value}.")
