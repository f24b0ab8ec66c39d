"""Numbers as an appendix writes them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import mean, quantiles, stdev
from typing import Any


def spread(values: Sequence[float], unit: str = "") -> str:
    """Returns the median with the middle half, such as `3.1 s (2.0 to 4.5)`; `none` without values."""
    if not values:
        return "none"
    low, middle, high = quantiles(values, n=4, method="inclusive") if len(values) > 1 else (values[0],) * 3
    return f"{_short(middle)}{unit} ({_short(low)} to {_short(high)})"


def moments(values: Sequence[float]) -> str:
    """Returns mean, standard deviation and range."""
    if not values:
        return "none"
    deviation = f", SD {_short(stdev(values))}" if len(values) > 1 else ""
    return f"M {_short(mean(values))}{deviation}, range {_short(min(values))} to {_short(max(values))}"


def counts(values: Iterable[Any]) -> str:
    """Returns how often each value occurs, the most frequent first, such as `woman 12, man 10`."""
    found = Counter(str(value) for value in values)
    in_order = sorted(found.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{value} {n}" for value, n in in_order) or "none"


def share(part: int, whole: int) -> str:
    """Returns a part of a whole, such as `12 of 16 (75 %)`."""
    return f"{part} of {whole} ({100 * part / whole:.0f} %)" if whole else "none"


def _short(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 or float(value).is_integer() else f"{value:.3g}"
