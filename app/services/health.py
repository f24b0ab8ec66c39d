"""What has gone slowly or wrong in this process lately: people who waited for a question, and questions that failed."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

LATELY_S = 600.0
"""What is longer ago is no news."""

_MOST = 1000


@dataclass(frozen=True)
class Lately:
    """What happened in the last ten minutes.

    Attributes:
        waits_s: How long people waited for a question that wasn't ready, in seconds, oldest first.
        n_failures: Questions that couldn't be computed.
    """

    waits_s: tuple[float, ...]
    n_failures: int


class Health:
    """Remembers it. Fit for many threads."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Nothing has happened yet.

        Args:
            clock: Gives seconds.
        """
        self._clock = clock
        self._lock = threading.Lock()
        self._waits: deque[tuple[float, float]] = deque(maxlen=_MOST)
        self._failures: deque[float] = deque(maxlen=_MOST)

    def waited(self, seconds: float) -> None:
        """Somebody has waited so long for a question."""
        with self._lock:
            self._waits.append((self._clock(), seconds))

    def failed(self) -> None:
        """A question couldn't be computed."""
        with self._lock:
            self._failures.append(self._clock())

    def lately(self) -> Lately:
        """Returns what happened lately."""
        with self._lock:
            since = self._clock() - LATELY_S
            waits = tuple(seconds for at, seconds in self._waits if at >= since)
            return Lately(waits, sum(at >= since for at in self._failures))
