"""Slopes of functions of the controls that have no gradient of their own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

# Features learned in single precision are rough below this scale of the controls.
_STEP = 1e-3


def central_differences(
    function: Callable[[Float[np.ndarray, "m n_controls"]], Float[np.ndarray, " m"]],
    points: Float[np.ndarray, "n n_controls"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_controls"]]:
    """Returns a function's values and its slopes by central differences, all from one call.

    Args:
        function: Takes a batch of controls; defined a little beyond their bounds as well.
        points: Where.
    """
    n, n_controls = points.shape
    steps = _STEP * np.vstack([np.zeros(n_controls), np.eye(n_controls), -np.eye(n_controls)])
    values = function((points[:, None] + steps).reshape(-1, n_controls)).reshape(n, -1)
    forward, backward = values[:, 1 : 1 + n_controls], values[:, 1 + n_controls :]
    return values[:, 0].copy(), (forward - backward) / (2.0 * _STEP)
