"""Keeps the stages of all participants who are here: built on arrival, closed a while after they leave."""

from __future__ import annotations

import asyncio
import threading
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from enum import Enum

from app.stage.framing import Layout
from app.stage.stage import Picture, Stage, StageBusyError

_LAYOUTS_REMEMBERED = 10_000


class Action(Enum):
    """What a participant's page may ask of its stage; each member's value is its name on the wire."""

    REPLAY = "replay"
    PAUSE = "pause"
    RESUME = "resume"
    WIDE = "wide"
    TALL = "tall"


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
        self._layouts: OrderedDict[str, Layout] = OrderedDict()
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
            self._layouts.pop(session_id, None)
            if session_id in self._seats:
                self._drop(session_id)

    def perform(self, session_id: str, action: Action) -> bool:
        """Does what a page asks.

        Returns:
            Whether it could be done: without a stage, only layouts can be noted, for when there is one.
        """
        if action in (Action.WIDE, Action.TALL):
            self._arrange(session_id, Layout(action.value))
            return True
        stage = self.find(session_id)
        if stage is None:
            return False
        {Action.REPLAY: stage.replay, Action.PAUSE: stage.pause, Action.RESUME: stage.resume}[action]()
        return True

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

    def _arrange(self, session_id: str, layout: Layout) -> None:
        with self._lock:
            self._layouts.pop(session_id, None)
            self._layouts[session_id] = layout
            while len(self._layouts) > _LAYOUTS_REMEMBERED:
                self._layouts.popitem(last=False)
        stage = self.find(session_id)
        if stage is not None:
            stage.set_layout(layout)

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
        seat = self._seats[session_id] = _Seat(Stage(self._layouts.get(session_id, Layout.WIDE)))
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
