"""Accuracy for somebody new, against how much they have answered: knowing other people, and knowing nobody else."""

from __future__ import annotations

from collections.abc import Collection, Mapping

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

_DASHES = (0, (3, 1.5))


def draw(accuracy: Curves, log_loss: Curves, alone: Collection[str], majority: float | None) -> Figure:
    """Returns accuracy and log loss against the number of own answers; each line is named at its end.

    Args:
        accuracy: Means over people.
        log_loss: The same of the log loss.
        alone: Predictors that know nobody else: dashed, with open marks.
        majority: Accuracy of always answering as most of the others did, if people saw the same queries.
    """
    figure = new_figure(9.5, 3.8)
    left, right = figure.subplots(1, 2)
    _lines(left, accuracy, alone, "Test answers predicted")
    if majority is not None:
        left.axhline(majority, color=GREY, linewidth=1, linestyle=(0, (1, 2)))
        left.annotate(
            "as most others answered",
            (0.0, majority),
            (0, -3),
            textcoords="offset points",
            fontsize=8,
            color=GREY,
            va="top",
        )
    _lines(right, log_loss, alone, "Log loss; less is better")
    return figure


def _lines(axes: Axes, curves: Curves, alone: Collection[str], title: str) -> None:
    for name, curve in curves.items():
        colour, places = PREDICTOR_COLOURS[name], range(len(curve))
        values = list(curve.values())
        axes.plot(
            places,
            [one.value for one in values],
            color=colour,
            linewidth=1.5 if name in alone else 2.0,
            linestyle=_DASHES if name in alone else "solid",
            marker="o",
            markersize=4,
            markerfacecolor="white" if name in alone else colour,
        )
        if name not in alone:
            low, high = [one.low for one in values], [one.high for one in values]
            axes.fill_between(places, low, high, color=colour, alpha=0.12, linewidth=0)
    numbers = [str(n) for n in next(iter(curves.values()))]
    axes.set_xticks(range(len(numbers)), numbers)
    axes.set_xlim(-0.1, len(numbers) - 0.9)
    axes.grid(axis="y", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    finish(axes, title, "own answers; solid: other people are known, dashed: nobody else is")
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
