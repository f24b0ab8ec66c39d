"""Slopes in the controls of what has no gradient of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

# Features learned in single precision are rough below this scale of the controls.
_STEP = 1e-3


def central_differences(
    function: Callable[[Float[np.ndarray, "m n_controls"]], Float[np.ndarray, "m *values"]],
    points: Float[np.ndarray, "n n_controls"],
) -> tuple[Float[np.ndarray, "n *values"], Float[np.ndarray, "n n_controls *values"]]:
    """Returns a function's values and its slopes by central differences, all from one call.

    Args:
        function: Takes a batch of controls; defined a little beyond their bounds as well.
        points: Where.
    """
    n, n_controls = points.shape
    steps = _STEP * np.vstack([np.zeros(n_controls), np.eye(n_controls), -np.eye(n_controls)])
    flat = function((points[:, None] + steps).reshape(-1, n_controls))
    values = flat.reshape(n, len(steps), *flat.shape[1:])
    forward, backward = values[:, 1 : 1 + n_controls], values[:, 1 + n_controls :]
    return values[:, 0].copy(), (forward - backward) / (2.0 * _STEP)
