"""Compiled comparison of paths: most are told apart long before their first frame is reached."""

import numpy as np
from numba import njit


@njit(cache=True)
def distinct_rows(paths, least_difference):
    """Returns the rows of `paths` that look different from every earlier row returned, in order."""
    rows = np.empty(paths.shape[0], dtype=np.int64)
    n_rows = 0
    for row in range(paths.shape[0]):
        if looks_new(paths, row, rows[:n_rows], least_difference):
            rows[n_rows] = row
            n_rows += 1
    return rows[:n_rows]


@njit(cache=True)
def looks_new(paths, row, others, least_difference):
    """Returns whether a row of `paths` looks different from all rows in `others`."""
    for other in others:  # noqa: SIM110 - numba compiles no generator expression
        if not _differ(paths[row], paths[other], least_difference):
            return False
    return True


@njit(cache=True)
def _differ(path_a, path_b, least_difference):
    """Returns whether two paths `(n_bodies, n_coordinates)` lie further apart than the bound."""
    for body in range(path_a.shape[0]):
        total = 0.0
        # Drives part with time, so the last frames tell most.
        for k in range(path_a.shape[1] - 1, -1, -1):
            apart = path_a[body, k] - path_b[body, k]
            total += apart * apart
            if total > least_difference * least_difference:
                return True
    return False
