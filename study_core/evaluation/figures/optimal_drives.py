"""The best drive of every person, by what was learned of them (the paper's Fig. 9)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from study_core.domain import Domain
from study_core.evaluation.figures.road import draw_drive, draw_other, draw_road, view_of
from study_core.evaluation.figures.style import BLUE, belongs_to, new_figure


def draw(domain: Domain, drives: Mapping[str, Mapping[str, Float[np.ndarray, " n_controls"]]]) -> Figure:
    """Returns a panel for each way to the best drive.

    Args:
        domain: Whose drives they are.
        drives: Controls by way, then by person.
    """
    every = np.stack([controls for of_people in drives.values() for controls in of_people.values()])
    view, n_rows = view_of(domain, every), -(-len(drives) // 2)
    figure = new_figure(9.5, n_rows * view.height(4.6))
    panels = figure.subplots(n_rows, 2, squeeze=False).ravel()
    for axes, (way, of_people) in zip(panels, drives.items(), strict=False):
        draw_road(axes, way, view)
        draw_other(axes, domain, every[0])
        for person, controls in of_people.items():
            line = draw_drive(axes, domain, controls, BLUE)
            line.set_alpha(0.65)
            belongs_to(line, person)
    for axes in panels[len(drives) :]:
        axes.set_visible(False)
    return figure
