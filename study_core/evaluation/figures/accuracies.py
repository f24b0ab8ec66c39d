"""Test accuracy of every person (the paper's Fig. 4), with more predictors beside the paper's two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study_core.evaluation.figures.style import FAINT, INK, PREDICTOR_COLOURS, belongs_to, finish, new_figure
from study_core.evaluation.intervals import Mean

_PAPERS = ("hand-coded-stored", "personal-network")
_WIDTH = 0.38


def draw(
    accuracy: Mapping[str, Mapping[str, float]],
    trials: Mapping[str, Sequence[float]],
    means: Mapping[str, Mean],
) -> Figure:
    """Returns the paper's two predictors as bars for each person, and all predictors' means beside them.

    Args:
        accuracy: By predictor, then person.
        trials: Of the personal network: accuracy of each of a person's best trials, whose mean is the bar and whose
            standard deviation the error bar.
        means: By predictor, over people.
    """
    figure = new_figure(9.5, 3.6)
    people_axes, mean_axes = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
    _bars(people_axes, accuracy[_PAPERS[0]], trials)
    _means(mean_axes, means)
    return figure


def _bars(axes: Axes, stored: Mapping[str, float], trials: Mapping[str, Sequence[float]]) -> None:
    for place, person in enumerate(stored):
        best = np.array(trials[person])
        left = axes.bar(place - 0.5 * _WIDTH, stored[person], _WIDTH, color=PREDICTOR_COLOURS[_PAPERS[0]])
        right = axes.bar(place + 0.5 * _WIDTH, best.mean(), _WIDTH, color=PREDICTOR_COLOURS[_PAPERS[1]])
        axes.errorbar(
            place + 0.5 * _WIDTH, best.mean(), best.std(), color=INK, linewidth=1, capsize=2, fmt="none"
        )
        for bar in (*left, *right):
            belongs_to(bar, person)
    axes.set_xticks(range(len(stored)), list(stored))
    axes.set_xlim(-0.7, len(stored) - 0.3)
    axes.set_ylim(0.0, 1.0)
    axes.grid(axis="y", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    finish(axes, "Share of test answers predicted", "person")
    for height, name, words in ((0.96, _PAPERS[0], "hand-coded"), (0.89, _PAPERS[1], "with a network")):
        axes.text(
            0.01,
            height,
            words,
            transform=axes.transAxes,
            color=PREDICTOR_COLOURS[name],
            fontsize=9,
            weight="bold",
        )


def _means(axes: Axes, means: Mapping[str, Mean]) -> None:
    ordered = sorted(means, key=lambda name: means[name].value)
    for place, name in enumerate(ordered):
        mean = means[name]
        axes.plot([mean.low, mean.high], [place, place], color=PREDICTOR_COLOURS[name], linewidth=2)
        axes.plot(mean.value, place, "o", color=PREDICTOR_COLOURS[name], markersize=6)
        axes.annotate(
            f"{name}  {mean.value:.3f}",
            (mean.low, place),
            (0, 6),
            textcoords="offset points",
            fontsize=8,
            color=INK,
        )
    axes.set_yticks([])
    axes.set_ylim(-0.5, len(ordered) - 0.2)
    axes.grid(axis="x", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    finish(axes, "Mean over people, 95 % interval", "accuracy")
    axes.spines["left"].set_visible(False)
