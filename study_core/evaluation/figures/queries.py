"""What a person would be asked next, by two methods (the paper's Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from study_core.comparison import Query
from study_core.domain import Domain
from study_core.evaluation.figures.road import draw_drive, draw_other, draw_road, name_end, view_of
from study_core.evaluation.figures.style import BLUE, VERMILION, new_figure


def draw(domain: Domain, queries: Mapping[str, Query]) -> Figure:
    """Returns a panel for each method: drive A with circles, drive B with triangles, a mark every half second."""
    controls = np.stack([row for query in queries.values() for row in (query.controls_a, query.controls_b)])
    view = view_of(domain, controls)
    figure = new_figure(9.5, len(queries) * view.height(9.0))
    panels = figure.subplots(len(queries), 1, squeeze=False)[:, 0]
    for axes, (method, query) in zip(panels, queries.items(), strict=True):
        draw_road(axes, method, view)
        draw_other(axes, domain, query.controls_a)
        for name, drive, colour, marker in (
            ("A", query.controls_a, BLUE, "o"),
            ("B", query.controls_b, VERMILION, "^"),
        ):
            name_end(axes, draw_drive(axes, domain, drive, colour, marker), name)
    return figure
