"""Whether a drive is safe: on the road, and clear of the other car."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from study_core.domains.driving.dynamics import HUMAN_PATH
from study_core.domains.driving.features import ROAD_EDGE

CAR_LENGTH, CAR_WIDTH = 0.24, 0.11
"""Of both cars as they are drawn, tyres included."""

# Where a car's outline is looked at: corners and the middles of its sides.
_OUTLINE = np.array([[x, y] for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5) if (x, y) != (0.0, 0.0)])


def stays_on_road(states: Float[np.ndarray, "n 50 4"]) -> Bool[np.ndarray, " n"]:
    """Returns whether a car's middle never leaves the road."""
    return np.asarray((np.abs(states[..., 0]) <= ROAD_EDGE).all(axis=1))


def collides(states: Float[np.ndarray, "n 50 4"]) -> Bool[np.ndarray, " n"]:
    """Returns whether the cars, as they are drawn, ever overlap: a point of one's outline is within the other."""
    other = np.broadcast_to(HUMAN_PATH[1:], states.shape)
    touches = _is_within(_outline(states), other) | _is_within(_outline(other), states)
    return np.asarray(touches.any(axis=(1, 2)))


def _outline(states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 50 8 2"]:
    """Returns points of the car's outline on the road."""
    across, along = _axes(states)
    sizes = _OUTLINE * np.array([CAR_WIDTH, CAR_LENGTH])
    offsets = across[..., None, :] * sizes[:, :1] + along[..., None, :] * sizes[:, 1:]
    return np.asarray(states[..., None, :2] + offsets)


def _is_within(
    points: Float[np.ndarray, "n 50 8 2"], states: Float[np.ndarray, "n 50 4"]
) -> Bool[np.ndarray, "n 50 8"]:
    across, along = _axes(states)
    apart = points - states[..., None, :2]
    x, y = (np.einsum("ntpk,ntk->ntp", apart, axis) for axis in (across, along))
    return np.asarray((np.abs(x) < 0.5 * CAR_WIDTH) & (np.abs(y) < 0.5 * CAR_LENGTH))


def _axes(
    states: Float[np.ndarray, "n 50 4"],
) -> tuple[Float[np.ndarray, "n 50 2"], Float[np.ndarray, "n 50 2"]]:
    """Returns the unit vectors across and along each car."""
    heading = states[..., 2]
    along = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.stack([along[..., 1], -along[..., 0]], axis=-1), along
