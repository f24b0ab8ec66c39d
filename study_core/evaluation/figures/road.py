"""Drives seen from above: what several figures draw on."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True)
class View:
    """What is seen of the road.

    Attributes:
        along: Ends of the stretch of road.
        across: How far it is seen to the left, negative, and to the right.
    """

    along: tuple[float, float]
    across: tuple[float, float]

    def height(self, width: float) -> float:
        """Returns how high a panel of this width is, its title included; in inches."""
        shape = (self.across[1] - self.across[0]) / (self.along[1] - self.along[0])
        return width * shape + 0.4


def view_of(domain: Domain, controls: Float[np.ndarray, "n n_controls"]) -> View:
    """Returns a view that holds all drives, and the road itself."""
    paths = np.concatenate([track.positions for row in controls for track in domain.scene(row).tracks])
    x, y = paths[:, 0], paths[:, 1]
    return View(
        (float(y.min()) - 0.2, float(y.max()) + 0.4),
        (min(float(x.min()), -ROAD_EDGE) - 0.1, max(float(x.max()), ROAD_EDGE) + 0.1),
    )


def draw_road(axes: Axes, title: str, view: View) -> None:
    """Prepares axes for drives from left to right, both directions to the same scale."""
    axes.axhspan(-ROAD_EDGE, ROAD_EDGE, color=_ROAD_GREY, linewidth=0)
    for edge in (-ROAD_EDGE, ROAD_EDGE):
        axes.axhline(edge, color=INK, linewidth=1)
    for line in (-0.5 * LANE_WIDTH, 0.5 * LANE_WIDTH):
        axes.axhline(line, color=GREY, linewidth=0.8, linestyle=(0, (6, 6)))
    axes.set_xlim(*view.along)
    # Right of the driver is down: the road runs to the right.
    axes.set_ylim(*view.across[::-1])
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
    """Draws the other car's drive; its name stands beside the road where it starts, before any drive leaves it."""
    path = domain.scene(controls).tracks[1].positions
    axes.plot(
        path[:, 1], path[:, 0], color=GREY, linewidth=1, marker="s", markersize=2.5, markevery=_STEPS_PER_MARK
    )
    across, along = path[0, :2]
    axes.annotate(
        "the other car",
        (along, across),
        (along, ROAD_EDGE + 0.03),
        color=GREY,
        fontsize=7,
        ha="center",
        va="top",
        arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 2},
    )
