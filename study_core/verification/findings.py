"""What a verification has found: which number isn't what it should be, and what couldn't be looked at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

EXACT = 0.0

ROUNDING = 1e-9
"""What another order of additions may change, relative to numbers above 1."""

Value = float | int | str | bool | None


@dataclass(frozen=True)
class Violation:
    """A stored number, or text, that isn't what its step should have come to.

    Attributes:
        query_index: The query that it belongs to.
        quantity: Its name, such as `query.features_a[2]`.
        stored: Its value.
        recomputed: What it should be.
        tolerance: By how much the two may differ; 0 where they must be equal.
    """

    query_index: int
    quantity: str
    stored: Value
    recomputed: Value
    tolerance: float

    def __str__(self) -> str:
        within = f" to within {self.tolerance:.3g}" if self.tolerance else ""
        values = f"stored {self.stored!r}, expected {self.recomputed!r}{within}"
        return f"query {self.query_index}: {self.quantity}: {values}"


@dataclass
class Findings:
    """Collects what is found about the queries of a session, one query after the other.

    Attributes:
        query_index: The query being looked at.
        violations: What isn't as it should be.
        n_compared: How many numbers and texts were.
        left_out: What couldn't be looked at, with how often.
    """

    query_index: int = 0
    violations: list[Violation] = field(default_factory=list)
    n_compared: int = 0
    left_out: Counter[str] = field(default_factory=Counter)

    def compare(self, quantity: str, stored: Value, expected: Value, tolerance: float = EXACT) -> None:
        """Compares a number with what it should be, to within a tolerance; or a text, or whether there is one."""
        self.n_compared += 1
        if not _is_close(stored, expected, tolerance):
            self.violations.append(Violation(self.query_index, quantity, stored, expected, tolerance))

    def compare_all(
        self,
        quantity: str,
        stored: Sequence[Value] | np.ndarray,
        expected: Sequence[Value] | np.ndarray,
        tolerance: float = EXACT,
    ) -> None:
        """Compares numbers, or texts, one by one; how many there are, too."""
        if len(stored) != len(expected):
            self.compare(f"number of {quantity}", len(stored), len(expected))
            return
        for place, (one, other) in enumerate(zip(_plain(stored), _plain(expected), strict=True)):
            self.compare(f"{quantity}[{place}]", one, other, tolerance)

    def require(self, quantity: str, holds: bool, stored: Value, expected: str) -> None:
        """Notes a violation unless something holds that isn't a difference of two numbers."""
        self.n_compared += 1
        if not holds:
            self.violations.append(Violation(self.query_index, quantity, stored, expected, EXACT))

    def leave_out(self, what: str) -> None:
        """Notes that something couldn't be looked at."""
        self.left_out[what] += 1


def _plain(values: Sequence[Value] | np.ndarray) -> Iterable[Value]:
    return values.tolist() if isinstance(values, np.ndarray) else values


def _is_close(stored: Value, expected: Value, tolerance: float) -> bool:
    if tolerance == EXACT or not isinstance(stored, float | int) or not isinstance(expected, float | int):
        return stored == expected
    return abs(stored - expected) <= tolerance * max(1.0, abs(expected))
