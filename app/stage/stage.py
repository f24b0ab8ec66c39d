"""One participant's stage: a viser server on the loopback address that plays one clip at a time.

How clips change without a flicker, and without waiting. viser's browser client parses a GLB asynchronously and
shows nothing of it until it is done, so replacing a clip under its own name leaves some frames empty. Therefore a
new clip is put in front of the old one, which it hides wholly from the very frame in which it has loaded. The page
sees the flag of the new clip and says so; then the old one is removed and the new one takes its place. Without
word from a page that happens after `SEEN_AT_LATEST_S`. A clip's clock starts when it has loaded.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import rich
import viser

from app.errors import AppError
from app.stage.clip import LEVEL_Z, N_FLAGS, TAIL_S, build_clip, duration_s
from app.stage.framing import CAMERA, Layout
from study_core.scene import Scene

APPEARS_S = 0.15
"""How long a new clip takes to appear, until the page has shown how long it takes there."""

SEEN_AT_LATEST_S = 3.0
"""When a new clip takes the old one's place though no page has said that it sees it."""

TELLS_S = 0.05
"""How long a page takes to say what it sees."""

_MOST_CLIPS = 3
_MOMENT_S = 0.001

_HOST = "127.0.0.1"
_FIRST_PORT = 8180


class StageError(AppError):
    """The stage can't do what it was asked."""


class StageBusyError(StageError):
    """Every stage this process may hold is in use."""

    def __init__(self, capacity: int) -> None:
        super().__init__(
            f"All {capacity} stages are in use. Try again when someone has finished, or raise the number of stages."
        )


class StageClosedError(StageError):
    """A stage was used after it had been closed."""

    def __init__(self) -> None:
        super().__init__("This stage has been closed. Enter it again through its keeper.")


@dataclass(frozen=True)
class Picture:
    """What a participant is to see: one query, A and B as shown (not as stored).

    Attributes:
        key: Tells one picture from the next.
        a: The scene under the letter A.
        b: The scene under the letter B.
        number: What its mark says (`app.stage.clip.mark_colour`).
    """

    key: str
    a: Scene
    b: Scene
    number: int = 0


@dataclass(frozen=True)
class Playing:
    """How the clip on a stage plays.

    Attributes:
        position_s: Where it is in its loop.
        end_s: Where both drives have ended.
        duration_s: Length of the loop.
        speed: Seconds of the loop per second.
        is_paused: Whether it stands still.
    """

    position_s: float
    end_s: float
    duration_s: float
    speed: float
    is_paused: bool


@dataclass
class _Play:
    """Where the current clip is in its loop."""

    start_s: float
    since: float
    is_frozen: bool
    speed: float


class Stage:
    """Shows pictures to one participant. Every method may be called from any thread and returns at once."""

    def __init__(self, layout: Layout = Layout.WIDE, clock: Callable[[], float] = time.monotonic) -> None:
        """Starts the viser server; takes some ten milliseconds.

        Args:
            layout: First arrangement of the sides.
            clock: Seconds from any origin.
        """
        self._clock = clock
        self._lock = threading.RLock()
        self._layout = layout
        self._picture: Picture | None = None
        self._play = _Play(0.0, clock(), False, 1.0)
        self._speed = 1.0
        self._appears_s = APPEARS_S
        self._starts_still = False
        # From the farthest to the nearest.
        self._clips: list[viser.GlbHandle] = []
        self._turn = 0
        self._is_seen = False
        self._is_closed = False
        self._server = _quiet_server()
        self.port: int = self._server.get_port()
        self._server.on_client_connect(self._welcome)

    @property
    def picture(self) -> Picture | None:
        """What is on the stage."""
        return self._picture

    @property
    def layout(self) -> Layout:
        """How the sides are arranged now."""
        return self._layout

    @property
    def is_paused(self) -> bool:
        """Whether the clip stands still."""
        return self._play.is_frozen

    @property
    def playing(self) -> Playing | None:
        """How the clip plays, or None while there is none."""
        with self._lock:
            if self._picture is None:
                return None
            length = duration_s(self._picture.a, self._picture.b)
            position = self._position_s() % length
            return Playing(position, length - TAIL_S, length, self._speed, self._play.is_frozen)

    def show(self, picture: Picture) -> None:
        """Shows a picture from its beginning, in place of the last one."""
        with self._lock:
            self._picture = picture
            self._change(0.0, self._starts_still)

    def replay(self) -> None:
        """Starts the clip again from its beginning."""
        with self._lock:
            self._change(0.0, False)

    def pause(self) -> None:
        """Stops the clip where it will be when the still one appears, so that nothing jumps."""
        with self._lock:
            if not self._play.is_frozen:
                self._change(self._position_when_changed_s(), True)

    def resume(self) -> None:
        """Goes on from where the clip was paused."""
        with self._lock:
            if self._play.is_frozen:
                self._change(self._play.start_s, False)

    def seek(self, position_s: float) -> None:
        """Goes to a place in the loop; stands still there, or plays on from there, as before."""
        with self._lock:
            if self._picture is None:
                return
            # The end of the loop is also its beginning; whoever goes there means the end.
            last_s = duration_s(self._picture.a, self._picture.b) - _MOMENT_S
            self._change(min(position_s, last_s), self._play.is_frozen)

    def set_speed(self, speed: float) -> None:
        """Plays this clip, from where it is, and all that follow at another speed.

        Args:
            speed: Seconds of the loop per second.
        """
        with self._lock:
            goes_on_at_s = self._position_when_changed_s()
            self._speed = speed
            if not self._play.is_frozen:
                self._change(goes_on_at_s, False)

    def set_still(self, starts_still: bool) -> None:
        """Says whether pictures wait at their first moment until they are told to play, the one shown now included."""
        with self._lock:
            if starts_still is not self._starts_still:
                self._starts_still = starts_still
                self._change(0.0, starts_still)

    def set_layout(self, layout: Layout) -> None:
        """Rearranges the sides; at once, because a picture in the wrong shape is worse than a blink."""
        with self._lock:
            if layout is not self._layout:
                self._layout = layout
                self._change(self._position_s(), self._play.is_frozen, at_once=True)

    def see(self, flag: int) -> None:
        """A page sees the clip with a flag: what it hides may go; another clip's flag changes nothing."""
        with self._lock:
            if self._is_seen or not self._clips or flag != self._flag:
                return
            seen_at = self._clock() - TELLS_S
            if len(self._clips) > 1:
                self._appears_s = min(max(seen_at - self._play.since, 0.0), SEEN_AT_LATEST_S)
            # Its clock has run since it loaded, not since it was sent.
            self._play.since = seen_at
            self._settle(self._turn)

    @property
    def _flag(self) -> int:
        return self._turn % N_FLAGS

    def close(self) -> None:
        """Stops the server and drops its clients; may take a second. Closing twice does no harm."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            self._turn += 1
        self._server.stop()

    def _position_s(self) -> float:
        """Where the clip is in its loop."""
        if self._play.is_frozen:
            return self._play.start_s
        return self._play.start_s + self._play.speed * (self._clock() - self._play.since)

    def _position_when_changed_s(self) -> float:
        """Where the clip that plays now will be when a new one takes its place."""
        return self._position_s() + self._appears_s * self._play.speed

    def _change(self, start_s: float, is_frozen: bool, at_once: bool = False) -> None:
        """Puts a new clip on the stage, in front of what is there; `at_once` takes that away before it has loaded."""
        if self._is_closed:
            raise StageClosedError
        if self._picture is None:
            return
        picture = self._picture
        start_s %= duration_s(picture.a, picture.b)
        self._turn += 1
        clip = build_clip(
            picture.a,
            picture.b,
            self._layout,
            start_s,
            is_frozen,
            self._speed,
            picture.number,
            self._flag,
        )
        self._play = _Play(start_s, self._clock(), is_frozen, self._speed)
        self._is_seen = False
        with self._server.atomic():
            self._drop_farthest(0 if at_once else _MOST_CLIPS - 1)
            self._clips.append(
                self._server.scene.add_glb(
                    f"/{self._turn % (_MOST_CLIPS + 1)}",
                    clip,
                    position=(0.0, 0.0, LEVEL_Z * len(self._clips)),
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
        # viser gathers messages for up to a sixtieth of a second; a person should not wait for that.
        self._server.flush()
        loop = self._server.get_event_loop()
        loop.call_soon_threadsafe(loop.call_later, SEEN_AT_LATEST_S, self._settle, self._turn)

    def _settle(self, turn: int) -> None:
        """Removes what the nearest clip hides, unless a newer one has come meanwhile."""
        with self._lock:
            if turn != self._turn or self._is_seen or self._is_closed:
                return
            self._is_seen = True
            with self._server.atomic():
                self._drop_farthest(1)

    def _drop_farthest(self, n_kept: int) -> None:
        """Removes the farthest clips and moves those that are kept back to where these were."""
        while len(self._clips) > n_kept:
            self._clips.pop(0).remove()
        for level, clip in enumerate(self._clips):
            clip.position = (0.0, 0.0, LEVEL_Z * level)

    def _welcome(self, client: viser.ClientHandle) -> None:
        """A browser has (re)connected: its clip starts anew, and its camera can't be moved."""
        distance = CAMERA.position[2]
        client.camera.min_orbit_distance = distance
        client.camera.max_orbit_distance = distance
        with self._lock:
            self._play.since = self._clock()
            self._is_seen = False
            if self._play.is_frozen and not self._is_closed:
                self._change(0.0, self._starts_still)


def _quiet_server() -> viser.ViserServer:
    """A viser server with nothing in it but the camera's place."""
    # viser announces every server's address with `rich.print`, whatever `verbose` says.
    rich.get_console().quiet = True
    server = viser.ViserServer(host=_HOST, port=_FIRST_PORT, verbose=False)
    server.scene.world_axes.visible = False
    # Clips bring their own light; the default environment map and lights would only cost time.
    server.scene.configure_default_lights(enabled=False)
    server.scene.configure_environment_map(hdri=None)
    server.initial_camera.up = CAMERA.up
    server.initial_camera.position = CAMERA.position
    server.initial_camera.look_at = CAMERA.look_at
    server.initial_camera.fov = CAMERA.fov_rad
    server.initial_camera.near = CAMERA.near
    server.initial_camera.far = CAMERA.far
    return server
