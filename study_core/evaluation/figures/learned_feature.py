"""What a network has learned: its feature against one input, the others held (the paper's Figs. 5 and 8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study_core.evaluation.figures.style import (
    BLUE,
    FAINT,
    GREY,
    INK,
    VERMILION,
    belongs_to,
    finish,
    new_figure,
)
from study_core.evaluation.learned import FeatureFn

HEADINGS_DEG = np.linspace(0.0, 360.0, 181)
SPEEDS = np.linspace(-1.0, 1.0, 101)
_STRAIGHT_AHEAD_DEG = 90.0


@dataclass(frozen=True)
class Held:
    """Where the inputs that don't vary are held.

    Attributes:
        names: Of the network's inputs, in their order; `heading` in radians.
        values: One for each.
    """

    names: tuple[str, ...]
    values: tuple[float, ...]

    def varied(self, name: str, over: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n n_inputs"]:
        """Returns inputs in which one varies."""
        inputs = np.tile(np.array(self.values), (len(over), 1))
        inputs[:, self.names.index(name)] = over
        return inputs


def against_heading(feature: FeatureFn, held: Held) -> Float[np.ndarray, " n"]:
    """Returns the feature at each of `HEADINGS_DEG`."""
    return feature(held.varied("heading", np.radians(HEADINGS_DEG)))


def against_speed(feature: FeatureFn, held: Held) -> Float[np.ndarray, " n"]:
    """Returns the feature at each of `SPEEDS`."""
    return feature(held.varied("speed", SPEEDS))


def draw_one(values: Float[np.ndarray, " n"]) -> Figure:
    """Returns one person's feature against heading, beside the hand-coded sin(theta) (Fig. 5)."""
    figure = new_figure(5.0, 3.2)
    axes = figure.subplots()
    axes.plot(HEADINGS_DEG, np.sin(np.radians(HEADINGS_DEG)), color=VERMILION, linewidth=1.5)
    axes.plot(HEADINGS_DEG, values, color=BLUE, linewidth=2)
    _name_end(axes, "learned", float(values[-1]), BLUE)
    _name_end(axes, "sin(heading)", 0.0, VERMILION)
    _finish_headings(axes, "Learned feature and heading, one person")
    return figure


def draw_all(
    by_heading: Mapping[str, Float[np.ndarray, " n_headings"]],
    by_speed: Mapping[str, Float[np.ndarray, " n_speeds"]],
) -> Figure:
    """Returns everybody's feature against heading and against speed (Fig. 8)."""
    figure = new_figure(9.5, 3.4)
    left, right = figure.subplots(1, 2, sharey=True)
    for person, values in by_heading.items():
        _line(left, person, HEADINGS_DEG, values)
        _line(right, person, SPEEDS, by_speed[person])
    left.plot(HEADINGS_DEG, np.sin(np.radians(HEADINGS_DEG)), color=VERMILION, linewidth=1.5)
    left.annotate(
        "sin(heading)", (135.0, 0.75), (6, 2), textcoords="offset points", color=VERMILION, fontsize=9
    )
    _finish_headings(left, "Learned feature and heading, everybody")
    right.axhline(0.0, color=FAINT, linewidth=0.7)
    finish(right, "Learned feature and speed, everybody", "speed")
    return figure


def _name_end(axes: Axes, name: str, value: float, colour: str) -> None:
    axes.annotate(
        name,
        (HEADINGS_DEG[-1], value),
        (6, -3),
        textcoords="offset points",
        color=colour,
        fontsize=9,
        annotation_clip=False,
    )


def _line(axes: Axes, person: str, x: np.ndarray, values: np.ndarray) -> None:
    (line,) = axes.plot(x, values, color=BLUE, linewidth=1.1, alpha=0.6)
    belongs_to(line, person)


def _finish_headings(axes: Axes, title: str) -> None:
    axes.axvline(_STRAIGHT_AHEAD_DEG, color=GREY, linewidth=1, linestyle=(0, (4, 2)))
    axes.annotate(
        "straight ahead",
        (_STRAIGHT_AHEAD_DEG, -1.16),
        (4, 0),
        textcoords="offset points",
        color=GREY,
        fontsize=8,
    )
    axes.set_xticks(range(0, 361, 90))
    axes.set_xlim(0, 360)
    axes.set_ylim(-1.2, 1.2)
    finish(axes, title, "heading, degrees", "feature")
    axes.yaxis.label.set_color(INK)
