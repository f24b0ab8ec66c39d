"""The picture of the method comparison."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, NullLocator

from app.bench.curve import Curve, Curves

# Okabe and Ito's palette, which the colour-blind can tell apart; the strongest for what matters most.
_COLOURS = {
    "information-gain-realistic": "#0072B2",
    "heuristic": "#D55E00",
    "random": "#000000",
    "information-gain": "#4BA3D6",
    "volume-removal": "#009E73",
    "regret": "#CC79A7",
    "heuristic-relative": "#D18F00",
    "thompson": "#808080",
}
_RECOMMENDED = "information-gain-realistic"
_FREE_CONTROLS = ("information-gain", "volume-removal")
_TITLES = {
    "alignment": "Alignment with the true weights",
    "regret": "Regret of the learned best drive",
    "held_out_accuracy": "Held-out pairs predicted",
}
_INK, _FAINT = "#222222", "#E3E3E3"
_LABEL_X, _LABEL_GAP = 1.06, 0.062


def draw(curves: Curves) -> Figure:
    """Returns every measure against the number of answers, each method's line named at its end."""
    figure = Figure(figsize=(14.0, 4.4), dpi=150, layout="constrained")
    for axes, measure in zip(figure.subplots(1, len(_TITLES)), _TITLES, strict=True):
        by_method = {method: by_measure[measure] for method, by_measure in curves.items()}
        for method, curve in by_method.items():
            _line(axes, method, curve)
        _finish(axes, measure, list(by_method.values()))
        _name_lines(axes, {method: float(curve.mean[-1]) for method, curve in by_method.items()})
    return figure


def _line(axes: Axes, method: str, curve: Curve) -> None:
    """Draws the mean, and the interval of the mean behind it; drives that nobody would want are dashed."""
    answers = np.arange(len(curve.mean))
    is_recommended = method == _RECOMMENDED
    axes.plot(
        answers,
        curve.mean,
        color=_COLOURS[method],
        linewidth=2.6 if is_recommended else 1.3,
        linestyle=(0, (4, 1.5)) if method in _FREE_CONTROLS else "solid",
        zorder=3 if is_recommended else 2,
    )
    axes.fill_between(answers, curve.low, curve.high, color=_COLOURS[method], alpha=0.09, linewidth=0)


def _finish(axes: Axes, measure: str, curves: list[Curve]) -> None:
    """Gives the axes the range of the means: what an interval adds below is only luck with few people."""
    lowest = min(float(curve.mean.min()) for curve in curves)
    highest = max(float(curve.mean.max()) for curve in curves)
    axes.set_title(_TITLES[measure], loc="left", fontsize=11, color=_INK, pad=10)
    axes.set_xlabel("answers", loc="left", fontsize=9, color=_INK)
    axes.set_xlim(0, len(curves[0].mean) - 1)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    if measure == "regret":
        axes.set_yscale("log")
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_ylim(0.5 * lowest, 2.0 * highest)
    else:
        axes.set_ylim(lowest - 0.1 * (1.0 - lowest), 1.0)
    axes.grid(axis="y", color=_FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set_color(_INK)
    axes.tick_params(length=0, labelsize=9, colors=_INK)


def _name_lines(axes: Axes, ends: dict[str, float]) -> None:
    """Writes each method's name beside the end of its line, pushed apart where the ends lie together."""
    to_axes = axes.transData - axes.transAxes
    heights = {method: float(to_axes.transform((0.0, end))[1]) for method, end in ends.items()}
    ordered = sorted(heights, key=lambda method: heights[method])
    for method, place in zip(ordered, _spread([heights[method] for method in ordered]), strict=True):
        axes.plot(
            [1.0, _LABEL_X - 0.01],
            [heights[method], place],
            transform=axes.transAxes,
            color=_COLOURS[method],
            linewidth=0.6,
            clip_on=False,
        )
        axes.text(
            _LABEL_X,
            place,
            method,
            transform=axes.transAxes,
            color=_COLOURS[method],
            fontsize=8.5,
            fontweight="bold" if method == _RECOMMENDED else "normal",
            verticalalignment="center",
        )


def _spread(heights: list[float]) -> list[float]:
    """Returns rising places at least a line apart, within the axes, near the rising heights given."""
    highest = 1.0 - _LABEL_GAP * np.arange(len(heights))[::-1]
    places: list[float] = []
    for height, limit in zip(heights, highest, strict=True):
        lowest = places[-1] + _LABEL_GAP if places else 0.0
        places.append(max(min(height, float(limit)), lowest))
    return places
