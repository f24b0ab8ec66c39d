"""The picture of `prefstudy bench posterior`: what the k-th update costs."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure


def draw(milliseconds: dict[int, list[float]]) -> Figure:
    """Returns the median time of an update against the number of answers, with the range of the middle four fifths."""
    answers = sorted(milliseconds)
    p10, median, p90 = np.array([np.percentile(milliseconds[k], [10, 50, 90]) for k in answers]).T
    figure = Figure(figsize=(6.0, 3.6), layout="constrained", dpi=150)
    axes = figure.add_subplot()
    axes.fill_between(answers, p10, p90, alpha=0.25, linewidth=0, label="middle four fifths")
    axes.plot(answers, median, marker="o", markersize=3.5, label="median")
    axes.set(xlabel="answers so far", ylabel="one update, ms", xlim=(0, None), ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    return figure
