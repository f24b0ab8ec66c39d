"""Who is in which condition: shown to owners who ask for it, and each look is in the audit."""

from __future__ import annotations

import threading
import time

from app.desk.admission import Admitted, NotAllowedError
from app.store import Arm, Store

# A page that keeps itself up to date is one look.
_SAME_LOOK_S = 600.0


class ConditionLooks:
    """Notes who looks at the conditions of what. Fit for many threads."""

    def __init__(self, store: Store) -> None:
        """Nobody has looked yet."""
        self._desk = store.desk
        self._last: dict[tuple[str, str], float] = {}
        self._lock = threading.Lock()

    def look(self, here: Admitted, about: str) -> None:
        """Lets somebody look.

        Args:
            here: Who it is.
            about: The study or session.

        Raises:
            NotAllowedError: They are no owner.
        """
        if not here.is_owner:
            raise NotAllowedError("Conditions are for owners; everybody else stays blind to them.")
        now = time.monotonic()
        with self._lock:
            is_same = now - self._last.get((here.name, about), -_SAME_LOOK_S) < _SAME_LOOK_S
            self._last[here.name, about] = now
        if not is_same:
            self._desk.record(here.name, "conditions_seen", about)


def blinded(arms: tuple[Arm, ...]) -> tuple[Arm, ...]:
    """Returns the balance of conditions without their names, in an order that doesn't tell them."""
    by_size = sorted(arms, key=lambda arm: (arm.n_completed, arm.n_under_way))
    return tuple(Arm(None, arm.n_completed, arm.n_under_way) for arm in by_size)
