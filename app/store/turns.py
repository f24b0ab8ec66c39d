"""A lock that is handed on in the order people came."""

from __future__ import annotations

import threading
from collections import deque


class Turns:
    """A mutual-exclusion lock, first come, first served; a context manager.

    `threading.Lock` goes to whoever runs at the moment, often the thread that has just let go of it: of 32
    writers some waited for half a second while others never did.
    """

    def __init__(self) -> None:
        """Begins unheld."""
        self._guard = threading.Lock()
        self._waiting: deque[threading.Lock] = deque()
        self._is_held = False

    def __enter__(self) -> None:
        """Waits for its turn."""
        with self._guard:
            if not self._is_held:
                self._is_held = True
                return
            my_turn = threading.Lock()
            my_turn.acquire()
            self._waiting.append(my_turn)
        try:
            my_turn.acquire()
        except BaseException:  # Ctrl-C while waiting: the queue must not wait for someone who has left
            self._leave(my_turn)
            raise

    def __exit__(self, *_: object) -> None:
        """Hands over to whoever has waited longest."""
        with self._guard:
            if self._waiting:
                self._waiting.popleft().release()
            else:
                self._is_held = False

    def _leave(self, turn: threading.Lock) -> None:
        with self._guard:
            if turn in self._waiting:
                self._waiting.remove(turn)
                return
        self.__exit__()
