"""Small pictures of numbers, as inline SVG: drawn with attributes and classes, because pages may hold no styles.

Each says in words what it shows, for whoever can't see it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from jaxtyping import Float
from markupsafe import Markup, escape

Format = Callable[[float], str]

_MARGIN_TOP, _MARGIN_BOTTOM = 10.0, 22.0
_GAP = 1.5


@dataclass(frozen=True)
class Scale:
    """One axis: which values it shows, and what is written along it.

    Attributes:
        low: The least.
        high: The most.
        ticks: Values that are written.
        written: How.
        is_logarithmic: Whether equal ratios are equally far apart.
    """

    low: float
    high: float
    ticks: tuple[float, ...]
    written: Format
    is_logarithmic: bool = False

    def share(self, value: float) -> float:
        """Returns where a value is, from 0 to 1; what lies outside is at the edge."""
        low, high, at = (self._placed(each) for each in (self.low, self.high, value))
        return min(max((at - low) / (high - low), 0.0), 1.0)

    def _placed(self, value: float) -> float:
        return math.log(max(value, 1e-9)) if self.is_logarithmic else value


@dataclass(frozen=True)
class _Frame:
    """Where a picture's values lie in it."""

    width: float
    height: float
    left: float
    x: Scale
    y: Scale

    def at(self, x: float, y: float) -> tuple[float, float]:
        return self.across(x), self.up(y)

    def across(self, x: float) -> float:
        return self.left + self.x.share(x) * (self.width - self.left - 8.0)

    def up(self, y: float) -> float:
        return self.floor - self.y.share(y) * (self.floor - _MARGIN_TOP)

    @property
    def floor(self) -> float:
        return self.height - _MARGIN_BOTTOM

    def svg(self, said: str, drawn: Iterator[str]) -> Markup:
        # Everything drawn is numbers, our own words, or escaped.
        return Markup(
            f'<svg class="chart" viewBox="0 0 {self.width:g} {self.height:g}" role="img" aria-label="{escape(said)}">'
            + "".join(drawn)
            + "</svg>"
        )

    def axes(self) -> Iterator[str]:
        for tick in self.x.ticks:
            # Words at the edges stay inside.
            share = self.x.share(tick)
            anchor = "start" if share < 0.06 else "end" if share > 0.94 else "middle"
            yield _text(self.across(tick), self.height - 6.0, self.x.written(tick), anchor)
        for tick in self.y.ticks:
            yield _line("grid", self.left, self.up(tick), self.width - 8.0, self.up(tick))
            yield _text(self.left - 6.0, self.up(tick) + 4.0, self.y.written(tick), "end")
        yield _line("axis", self.left, self.floor, self.width - 8.0, self.floor)


def histogram(values: Sequence[float], label: str, scale: Scale, n_bins: int = 12) -> Markup:
    """Returns how values are spread, with their median.

    Args:
        values: At least one.
        label: What they are.
        scale: Of the values; those outside count into the first or last bar.
        n_bins: Bars.
    """
    counts = [0] * n_bins
    for value in values:
        counts[min(int(scale.share(value) * n_bins), n_bins - 1)] += 1
    middle, most = median(values), max(counts)
    frame = _Frame(320.0, 120.0, 8.0, scale, Scale(0.0, most, (), str))
    said = (
        f"{label} of {len(values)} people: median {scale.written(middle)}, "
        f"from {scale.written(min(values))} to {scale.written(max(values))}."
    )

    def drawn() -> Iterator[str]:
        yield from frame.axes()
        width = (frame.width - frame.left - 8.0) / n_bins
        for index, count in enumerate(counts):
            if count:
                top = frame.up(count)
                yield (
                    f'<rect class="bar" x="{frame.left + index * width + _GAP / 2:.1f}" y="{top:.1f}" '
                    f'width="{width - _GAP:.1f}" height="{frame.floor - top:.1f}" rx="1.5"/>'
                )
        yield _line("median", frame.across(middle), 4.0, frame.across(middle), frame.floor)

    return frame.svg(said, drawn())


def intervals(
    names: Sequence[str],
    means: Float[np.ndarray, " d"],
    lows: Float[np.ndarray, " d"],
    highs: Float[np.ndarray, " d"],
) -> Markup:
    """Returns weights with their 90 % intervals, one a row."""
    scale = _weights(lows)
    frame = _Frame(560.0, 28.0 * len(names) + 34.0, 150.0, scale, Scale(0.0, 1.0, (), str))
    rows = list(zip(names, means.tolist(), lows.tolist(), highs.tolist(), strict=True))
    said = "; ".join(
        f"{name} {_signed(mean)}, 90 % between {_signed(low)} and {_signed(high)}"
        for name, mean, low, high in rows
    )

    def drawn() -> Iterator[str]:
        yield from frame.axes()
        yield _line("grid", frame.across(0.0), _MARGIN_TOP, frame.across(0.0), frame.floor)
        for number, (name, mean, low, high) in enumerate(rows):
            y = _MARGIN_TOP + 28.0 * number + 14.0
            yield _text(frame.left - 12.0, y + 4.0, name, "end", "label")
            yield _line("interval", frame.across(low), y, frame.across(high), y)
            yield f'<circle class="dot" cx="{frame.across(mean):.1f}" cy="{y:.1f}" r="5"/>'

    return frame.svg(f"Weights: {said}.", drawn())


def _weights(lows: Iterable[float]) -> Scale:
    """Returns the axis of weights: from 0, or from -1 where some may be negative, as a learned feature's may."""
    if min(lows) >= 0.0:
        return Scale(0.0, 1.0, (0.0, 0.5, 1.0), _plain)
    return Scale(-1.0, 1.0, (-1.0, 0.0, 1.0), _plain)


def band(
    name: str,
    queries: Sequence[int],
    means: Sequence[float],
    lows: Sequence[float],
    highs: Sequence[float],
) -> Markup:
    """Returns how one weight's mean and 90 % interval moved, question by question."""
    frame = _Frame(320.0, 120.0, 34.0, _questions(queries), _weights(lows))
    edge = [*zip(queries, highs, strict=True), *reversed(list(zip(queries, lows, strict=True)))]
    said = f"{name}: from {_signed(means[0])} to {_signed(means[-1])} over {len(queries)} posteriors."

    def drawn() -> Iterator[str]:
        yield from frame.axes()
        yield f'<polygon class="band" points="{_points(frame, edge)}"/>'
        yield f'<polyline class="line" points="{_points(frame, zip(queries, means, strict=True))}"/>'

    return frame.svg(said, drawn())


def course(
    label: str, queries: Sequence[int], values: Sequence[float], scale: Scale, limit: float | None = None
) -> Markup:
    """Returns how a number went, question by question, with the bound that it should keep."""
    frame = _Frame(320.0, 120.0, 44.0, _questions(queries), scale)
    last, least, most = (scale.written(value) for value in (values[-1], min(values), max(values)))
    said = f"{label}: last {last}, from {least} to {most}."

    def drawn() -> Iterator[str]:
        yield from frame.axes()
        if limit is not None:
            yield _line("limit", frame.left, frame.up(limit), frame.width - 8.0, frame.up(limit))
        for x, y in zip(queries, values, strict=True):
            across, up = frame.at(x, y)
            yield f'<circle class="dot" cx="{across:.1f}" cy="{up:.1f}" r="2.6"/>'

    return frame.svg(said, drawn())


def of_shares() -> Scale:
    """Returns the scale of shares, from 0 to 1."""
    return Scale(0.0, 1.0, (0.0, 0.5, 1.0), lambda value: f"{value:.0%}")


def up_to(most: float, written: Format) -> Scale:
    """Returns the scale of amounts from 0 to a round number that holds them all."""
    top = _round_up(most)
    return Scale(0.0, top, (0.0, top / 2, top), written)


def _round_up(value: float) -> float:
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(value))
    return next(unit * step for step in (1.0, 2.0, 4.0, 5.0, 6.0, 8.0, 10.0) if unit * step >= value - 1e-9)


def _questions(queries: Sequence[int]) -> Scale:
    first, last = min(queries), max(max(queries), min(queries) + 1)
    return Scale(
        first,
        last,
        (first, last),
        lambda query: f"question {query + 1:.0f}" if query == first else f"{query + 1:.0f}",
    )


def _signed(value: float) -> str:
    return f"{value:.2f}".replace("-", "−") if value else "0"


def _plain(value: float) -> str:
    return f"{value:g}".replace("-", "−")


def _points(frame: _Frame, values: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in (frame.at(*value) for value in values))


def _line(kind: str, x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def _text(x: float, y: float, text: str, anchor: str, kind: str = "tick") -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
