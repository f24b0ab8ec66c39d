"""Accuracy for somebody new, against how much they have answered."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study_core.evaluation.figures.style import (
    FAINT,
    GREY,
    INK,
    PREDICTOR_COLOURS,
    finish,
    new_figure,
    spread_labels,
)
from study_core.evaluation.intervals import Mean

Curves = Mapping[str, Mapping[int, Mean]]
"""By predictor, then by number of own answers."""


def draw(accuracy: Curves, log_loss: Curves, majority: float | None) -> Figure:
    """Returns accuracy and log loss against the number of own answers; each line is named at its end.

    Args:
        accuracy: Means over people.
        log_loss: The same of the log loss.
        majority: Accuracy of always answering as most of the others did, if people saw the same queries.
    """
    figure = new_figure(9.5, 3.4)
    left, right = figure.subplots(1, 2)
    _lines(left, accuracy, "Test answers predicted")
    if majority is not None:
        left.axhline(majority, color=GREY, linewidth=1, linestyle=(0, (4, 2)))
        left.annotate(
            "as the others answered",
            (0.0, majority),
            (3, 3),
            textcoords="offset points",
            fontsize=8,
            color=GREY,
        )
    _lines(right, log_loss, "Log loss; less is better")
    return figure


def _lines(axes: Axes, curves: Curves, title: str) -> None:
    for name, curve in curves.items():
        places = range(len(curve))
        values = list(curve.values())
        axes.plot(
            places,
            [one.value for one in values],
            color=PREDICTOR_COLOURS[name],
            linewidth=1.8,
            marker="o",
            markersize=3.5,
        )
        axes.fill_between(
            places,
            [one.low for one in values],
            [one.high for one in values],
            color=PREDICTOR_COLOURS[name],
            alpha=0.12,
            linewidth=0,
        )
    numbers = [str(n) for n in next(iter(curves.values()))]
    axes.set_xticks(range(len(numbers)), numbers)
    axes.set_xlim(0, len(numbers) - 1)
    axes.grid(axis="y", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    finish(axes, title, "own answers")
    _name_ends(axes, {name: list(curve.values())[-1].value for name, curve in curves.items()})


def _name_ends(axes: Axes, ends: dict[str, float]) -> None:
    low, high = axes.get_ylim()
    heights = spread_labels(list(ends.values()), 0.065 * (high - low))
    for (name, value), height in zip(ends.items(), heights, strict=True):
        axes.annotate(
            name,
            (1.0, value),
            (1.04, height),
            xycoords=("axes fraction", "data"),
            textcoords=("axes fraction", "data"),
            fontsize=8,
            color=PREDICTOR_COLOURS[name],
            va="center",
            arrowprops={
                "arrowstyle": "-",
                "color": PREDICTOR_COLOURS[name],
                "linewidth": 0.7,
                "shrinkA": 0,
                "shrinkB": 0,
            },
            annotation_clip=False,
        )
    axes.yaxis.label.set_color(INK)
