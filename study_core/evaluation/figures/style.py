"""What all figures look like: readable in print, without colour too, and to the colour-blind."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's palette.
BLUE, VERMILION, GREEN, ORANGE, PURPLE = "#0072B2", "#D55E00", "#009E73", "#D18F00", "#CC79A7"
INK, GREY, FAINT = "#222222", "#808080", "#E3E3E3"

PERSON_PREFIX = "person:"
"""What the SVG id of a person's artist begins with."""

PREDICTOR_COLOURS = {
    "hand-coded-stored": GREY,
    "hand-coded-calibrated": GREEN,
    "hand-coded-population": GREEN,
    "personal-network": VERMILION,
    "personal-calibrated": ORANGE,
    "shared-network": PURPLE,
    "hierarchical": BLUE,
}
# A predictor cut off from other people keeps its colour, and is told apart by its line; `hand-coded-calibrated` is
# `hand-coded-population` without them.
PREDICTOR_COLOURS |= {f"{name}-alone": PREDICTOR_COLOURS[name] for name in ("shared-network", "hierarchical")}


def new_figure(width: float, height: float) -> Figure:
    """Returns an empty figure; sizes in inches, 7 inches being a printed page's width."""
    return Figure(figsize=(width, height), dpi=150, layout="constrained")


def finish(axes: Axes, title: str, x_label: str, y_label: str = "") -> None:
    """Gives axes their words, and takes away what isn't data."""
    axes.set_title(title, loc="left", fontsize=10, color=INK, pad=8)
    axes.set_xlabel(x_label, loc="left", fontsize=9, color=INK)
    axes.set_ylabel(y_label, fontsize=9, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(INK)
    axes.tick_params(length=2, labelsize=8, colors=INK)


def belongs_to(artist: Artist, person: str) -> None:
    """Says whose an artist is."""
    artist.set_gid(f"{PERSON_PREFIX}{person}")


def spread_labels(positions: list[float], gap: float) -> list[float]:
    """Returns heights as close as can be to the wanted ones, at least `gap` apart, in the same order.

    Labels that would overlap are pooled around their mean, as in isotonic regression.
    """
    order = sorted(range(len(positions)), key=lambda index: positions[index])
    groups: list[list[float]] = []
    for rank, index in enumerate(order):
        groups.append([positions[index] - rank * gap, 1.0])
        while len(groups) > 1 and groups[-2][0] > groups[-1][0]:
            (low, n_low), (high, n_high) = groups[-2:]
            groups[-2:] = [[(low * n_low + high * n_high) / (n_low + n_high), n_low + n_high]]
    levels = [level for level, count in groups for _ in range(int(count))]
    spread = [0.0] * len(positions)
    for rank, index in enumerate(order):
        spread[index] = levels[rank] + rank * gap
    return spread
