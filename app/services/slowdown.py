"""Wrong passwords cost time: each one more than the last, up to a bound, so that nobody is shut out for ever."""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from dataclasses import dataclass
from time import monotonic

_MOST_KEYS = 10_000
_FORGOTTEN_AFTER_S = 3600.0


@dataclass(frozen=True)
class _Failures:
    """How often somebody has failed.

    Attributes:
        n: How often in a row.
        at: When last, by a clock that is never set back, in seconds.
    """

    n: int
    at: float


class Slowdown:
    """Counts failures by key, such as a name or an address, and says how long that key has to wait.

    After `n_free` failures in a row the wait is one second, and doubles with each, up to `longest_s`. An hour without a
    failure, or a success, and it begins anew. Fit for many threads.
    """

    def __init__(self, n_free: int, longest_s: float) -> None:
        """Nobody has failed yet.

        Args:
            n_free: Failures in a row that cost nothing.
            longest_s: The longest wait, in seconds.
        """
        self._n_free, self._longest_s = n_free, longest_s
        self._failures: OrderedDict[str, _Failures] = OrderedDict()
        self._lock = threading.Lock()

    def wait_s(self, key: str) -> int:
        """Returns how many seconds a key has to wait until its next try; 0 if it hasn't."""
        with self._lock:
            known = self._known(key)
            if known.n < self._n_free:
                return 0
            # No power of two is computed that is larger than it has to be.
            delay = min(self._longest_s, 2.0 ** min(known.n - self._n_free, 30))
            return max(0, math.ceil(known.at + delay - monotonic()))

    def failed(self, key: str) -> None:
        """Counts a failure."""
        with self._lock:
            self._failures[key] = _Failures(self._known(key).n + 1, monotonic())
            self._failures.move_to_end(key)
            while len(self._failures) > _MOST_KEYS:
                self._failures.popitem(last=False)

    def succeeded(self, key: str) -> None:
        """Forgets a key's failures."""
        with self._lock:
            self._failures.pop(key, None)

    def _known(self, key: str) -> _Failures:
        known = self._failures.get(key, _Failures(0, 0.0))
        return known if monotonic() - known.at < _FORGOTTEN_AFTER_S else _Failures(0, 0.0)
