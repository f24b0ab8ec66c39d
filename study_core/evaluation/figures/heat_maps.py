"""A learned feature over the road, at some moments of the other car (the paper's Figs. 6 and 7)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from study_core.domain import Domain
from study_core.domains.driving.safety import CAR_LENGTH, CAR_WIDTH
from study_core.evaluation.figures.style import INK, VERMILION, new_figure
from study_core.evaluation.learned import FeatureFn

# Steps at which the other car is looked at, spread over its drive.
MOMENTS = (4, 14, 24, 34, 44)
_SPEED, _HEADING = 1.0, 0.5 * np.pi
_LABEL_BOX = {"facecolor": INK, "alpha": 0.6, "edgecolor": "none", "pad": 2}
_ACROSS, _ALONG = np.linspace(-0.4, 0.4, 61), np.linspace(-0.6, 2.6, 161)


def over_the_road(domain: Domain, feature: FeatureFn, moment: int) -> Float[np.ndarray, "n_along n_across"]:
    """Returns the feature of a car at each place, going straight ahead with speed 1, at one moment of the other car."""
    along, across = np.meshgrid(_ALONG, _ACROSS, indexing="ij")
    here = np.stack(
        [across.ravel(), along.ravel(), np.full(along.size, _HEADING), np.full(along.size, _SPEED)], axis=-1
    )
    n_steps = domain.rollout(domain.control_lower[None]).shape[1]
    values = feature(domain.network_inputs(np.repeat(here[:, None], n_steps, axis=1))[:, moment])
    return np.asarray(values).reshape(along.shape)


def draw(domain: Domain, maps: Float[np.ndarray, "n_moments n_along n_across"]) -> Figure:
    """Returns the maps one above the other, the road running to the right; all on one scale of brightness."""
    figure = new_figure(6.5, 1.42 * len(maps) + 0.5)
    panels = figure.subplots(len(maps), 1, sharex=True)
    path = domain.scene(domain.control_lower).tracks[1].positions
    extent = (_ALONG[0], _ALONG[-1], _ACROSS[-1], _ACROSS[0])
    low, high = float(maps.min()), float(maps.max())
    for axes, values, moment in zip(panels, maps, MOMENTS, strict=True):
        image = axes.imshow(values.T, extent=extent, cmap="viridis", vmin=low, vmax=high, aspect="equal")
        # The path starts before the first step.
        x, y = path[moment + 1, :2]
        axes.add_patch(
            Rectangle(
                (y - 0.5 * CAR_LENGTH, x - 0.5 * CAR_WIDTH),
                CAR_LENGTH,
                CAR_WIDTH,
                facecolor=VERMILION,
                edgecolor="white",
                linewidth=1,
            )
        )
        axes.set_yticks([])
        axes.text(
            0.01, 0.82, f"{(moment + 1) / 10:.1f} s", transform=axes.transAxes, fontsize=9, color="white"
        )
        axes.tick_params(labelsize=8, length=2, colors=INK)
        axes.spines[:].set_visible(False)
    panels[-1].set_xlabel("along the road; the other car in red", loc="left", fontsize=9, color=INK)
    bar = figure.colorbar(image, ax=list(panels), shrink=0.5, pad=0.02)
    bar.ax.tick_params(labelsize=8, colors=INK)
    bar.outline.set_visible(False)
    return figure
