"""How often each predictor is right, by how sure it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study_core.evaluation.figures.style import FAINT, GREY, INK, PREDICTOR_COLOURS, finish, new_figure
from study_core.evaluation.scores import CalibrationBin

_COLUMNS = 4


def draw(bins: Mapping[str, Sequence[CalibrationBin]]) -> Figure:
    """Returns one panel for each predictor; on the diagonal, confidence is deserved.

    Args:
        bins: By predictor: all people's predictions, binned by confidence.
    """
    n_rows = -(-len(bins) // _COLUMNS)
    figure = new_figure(9.5, 2.4 * n_rows + 0.3)
    panels = figure.subplots(n_rows, _COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for place, (axes, (name, of_predictor)) in enumerate(zip(panels, bins.items(), strict=False)):
        _panel(axes, name, of_predictor)
        is_lowest = place + _COLUMNS >= len(bins)
        axes.tick_params(labelbottom=is_lowest)
        axes.set_xlabel("confidence" if is_lowest else "")
        axes.set_ylabel("" if place % _COLUMNS else "share right")
    for axes in panels[len(bins) :]:
        axes.set_visible(False)
    return figure


def _panel(axes: Axes, name: str, bins: Sequence[CalibrationBin]) -> None:
    axes.plot([0.5, 1.0], [0.5, 1.0], color=GREY, linewidth=1, linestyle=(0, (4, 2)))
    confidence, accuracy = [one.confidence for one in bins], [one.accuracy for one in bins]
    error = [2.0 * (one.accuracy * (1.0 - one.accuracy) / one.n) ** 0.5 for one in bins]
    axes.errorbar(
        confidence,
        accuracy,
        error,
        color=PREDICTOR_COLOURS[name],
        marker="o",
        markersize=4,
        linewidth=1.5,
        elinewidth=0.8,
        ecolor=INK,
    )
    axes.set_xlim(0.48, 1.02)
    axes.set_ylim(0.3, 1.02)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    finish(axes, name, "confidence", "share right")
