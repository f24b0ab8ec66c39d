"""Tells open responses that a session's log has grown."""

from __future__ import annotations

import asyncio
from collections import defaultdict


class Changes:
    """Events of one event loop, set from any thread.

    Attributes:
        is_closing: Whether the server is ending, so that there is nothing to wait for any more.
    """

    def __init__(self) -> None:
        self.is_closing = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: dict[str, set[asyncio.Event]] = defaultdict(set)

    def start(self) -> None:
        """Binds to the running loop; changes before that reach nobody, because nobody waits yet."""
        self._loop = asyncio.get_running_loop()

    def notify(self, session_id: str) -> None:
        """Wakes everyone who waits for the session; callable from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake, session_id)

    def close(self) -> None:
        """Wakes everyone for good, so that no response outlives the server."""
        self.is_closing = True
        for session_id in list(self._waiting):
            self._wake(session_id)

    def listen(self, session_id: str) -> asyncio.Event:
        """Returns an event that is set at the session's next change; hand it back to `forget`."""
        event = asyncio.Event()
        self._waiting[session_id].add(event)
        return event

    def forget(self, session_id: str, event: asyncio.Event) -> None:
        """Stops listening."""
        self._waiting[session_id].discard(event)
        if not self._waiting[session_id]:
            del self._waiting[session_id]

    def _wake(self, session_id: str) -> None:
        for event in self._waiting.get(session_id, ()):
            event.set()
