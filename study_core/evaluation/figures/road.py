"""Drives seen from above: what several figures draw on."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from study_core.domain import Domain
from study_core.domains.driving.features import LANE_WIDTH, ROAD_EDGE
from study_core.evaluation.figures.style import GREY, INK, finish

# Marks at equal time intervals: every half second.
_STEPS_PER_MARK = 5
_ROAD_GREY = "#F1F1F1"


def draw_road(axes: Axes, title: str, along: tuple[float, float], across: float) -> None:
    """Prepares axes for drives from left to right, both directions to the same scale.

    Args:
        axes: Where.
        title: What is seen.
        along: Ends of the stretch of road.
        across: How far to both sides of the middle.
    """
    axes.axhspan(-ROAD_EDGE, ROAD_EDGE, color=_ROAD_GREY, linewidth=0)
    for edge in (-ROAD_EDGE, ROAD_EDGE):
        axes.axhline(edge, color=INK, linewidth=1)
    for line in (-0.5 * LANE_WIDTH, 0.5 * LANE_WIDTH):
        axes.axhline(line, color=GREY, linewidth=0.8, linestyle=(0, (6, 6)))
    axes.set_xlim(*along)
    # Right of the driver is down: the road runs to the right.
    axes.set_ylim(across, -across)
    axes.set_aspect("equal")
    finish(axes, title, "")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[["left", "bottom"]].set_visible(False)


def draw_drive(
    axes: Axes, domain: Domain, controls: Float[np.ndarray, " n_controls"], colour: str, marker: str = "o"
) -> Line2D:
    """Draws one drive of the robot car from its start on, with a mark every half second."""
    path = domain.scene(controls).tracks[0].positions
    (line,) = axes.plot(
        path[:, 1],
        path[:, 0],
        color=colour,
        linewidth=1.3,
        marker=marker,
        markersize=3,
        markevery=_STEPS_PER_MARK,
    )
    return line


def name_end(axes: Axes, line: Line2D, name: str) -> None:
    """Writes a drive's name where it ends."""
    end = (float(np.asarray(line.get_xdata())[-1]), float(np.asarray(line.get_ydata())[-1]))
    colour = line.get_color()
    axes.annotate(name, end, (5, -3), textcoords="offset points", color=colour, weight="bold", fontsize=9)


def draw_other(axes: Axes, domain: Domain, controls: Float[np.ndarray, " n_controls"]) -> None:
    """Draws the other car's drive."""
    path = domain.scene(controls).tracks[1].positions
    axes.plot(
        path[:, 1], path[:, 0], color=GREY, linewidth=1, marker="s", markersize=2.5, markevery=_STEPS_PER_MARK
    )
    end = (path[-1, 1], path[-1, 0])
    axes.annotate("the other car", end, (4, -2), textcoords="offset points", color=GREY, fontsize=7)


def extent(domain: Domain, controls: Float[np.ndarray, "n n_controls"]) -> tuple[tuple[float, float], float]:
    """Returns the stretch of road, and how far to its sides, that holds all drives and the road itself."""
    paths = np.concatenate([track.positions for row in controls for track in domain.scene(row).tracks])
    along = (float(paths[:, 1].min()) - 0.2, float(paths[:, 1].max()) + 0.4)
    return along, max(float(np.abs(paths[:, 0]).max()) + 0.1, ROAD_EDGE + 0.1)
