"""The weights of every person: posterior means and 90 % ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from study_core.evaluation.figures.style import BLUE, FAINT, belongs_to, finish, new_figure


def draw(
    feature_names: Sequence[str], samples: Mapping[str, Float[np.ndarray, "n_samples n_features"]]
) -> Figure:
    """Returns a panel for each feature, a row for each person.

    Args:
        feature_names: Of the hand-coded features.
        samples: Posterior samples of w, by person.
    """
    figure = new_figure(9.5, 0.22 * len(samples) + 1.0)
    panels = figure.subplots(1, len(feature_names), sharey=True, squeeze=False)[0]
    for k, (axes, feature) in enumerate(zip(panels, feature_names, strict=True)):
        for row, (person, of_person) in enumerate(samples.items()):
            low, high = np.quantile(of_person[:, k], [0.05, 0.95])
            (line,) = axes.plot([low, high], [row, row], color=BLUE, linewidth=1.5)
            (dot,) = axes.plot(of_person[:, k].mean(), row, "o", color=BLUE, markersize=4)
            belongs_to(line, person)
            belongs_to(dot, person)
        axes.set_xlim(0.0, 1.0)
        axes.grid(axis="x", color=FAINT, linewidth=0.7)
        axes.set_axisbelow(True)
        finish(axes, feature, "weight")
    panels[0].set_yticks(range(len(samples)), list(samples))
    panels[0].invert_yaxis()
    panels[0].set_ylabel("person", fontsize=9)
    return figure
