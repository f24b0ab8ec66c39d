"""Compiled bookkeeping of the batched projected L-BFGS: everything but the evaluation of the domain."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

MOVING, CONVERGED = 0, 1

# A row has converged when its projected gradient, or what a step still gains, is negligible.
_GRADIENT_TOLERANCE = 1e-7
_VALUE_TOLERANCE = 1e-13
_ARMIJO = 1e-4
_SMALLEST_STEP = 1e-12


class State(NamedTuple):
    """All rows of the batch; the leading axis of every array is the row.

    `point`, `value`, `gradient` are the last accepted; `trial` is what to evaluate next, at `step` along `direction`
    from `point`. `steps` and `changes` hold the last pairs (s, y), `n_pairs` how many, in a ring.
    """

    point: np.ndarray
    value: np.ndarray
    gradient: np.ndarray
    trial: np.ndarray
    direction: np.ndarray
    step: np.ndarray
    steps: np.ndarray
    changes: np.ndarray
    n_pairs: np.ndarray
    status: np.ndarray


def initial_state(starts: np.ndarray, memory: int) -> State:
    """Returns the state in which every row is about to evaluate its start."""
    n, n_controls = starts.shape
    return State(
        point=starts.copy(),
        value=np.full(n, np.inf),
        gradient=np.zeros((n, n_controls)),
        trial=starts.copy(),
        direction=np.zeros((n, n_controls)),
        step=np.ones(n),
        steps=np.zeros((n, memory, n_controls)),
        changes=np.zeros((n, memory, n_controls)),
        n_pairs=np.zeros(n, dtype=np.int64),
        status=np.full(n, MOVING),
    )


@njit(cache=True)
def advance(
    rows,
    values,
    gradients,
    lower,
    upper,
    point,
    value,
    gradient,
    trial,
    direction,
    step,
    steps,
    changes,
    n_pairs,
    status,
):
    """Takes the evaluation of each row's trial: accepts it and aims anew, or halves the step."""
    for i in range(rows.shape[0]):
        r = rows[i]
        if _is_accepted(values[i], value[r], gradient[r], point[r], trial[r]):
            gain = value[r] - values[i]
            _remember(point[r], trial[r], gradient[r], gradients[i], steps[r], changes[r], n_pairs, r)
            point[r] = trial[r]
            value[r] = values[i]
            gradient[r] = gradients[i]
            if _is_optimal(point[r], gradient[r], lower, upper) or gain <= _VALUE_TOLERANCE * max(
                1.0, abs(value[r])
            ):
                status[r] = CONVERGED
                continue
            _aim(point[r], gradient[r], lower, upper, steps[r], changes[r], n_pairs[r], direction[r])
            step[r] = 1.0 if n_pairs[r] > 0 else _first_step(direction[r], lower, upper)
        else:
            step[r] *= 0.5 if values[i] < math.inf else 0.1
            if step[r] < _SMALLEST_STEP:
                status[r] = CONVERGED
                continue
        for k in range(lower.shape[0]):
            trial[r, k] = min(max(point[r, k] + step[r] * direction[r, k], lower[k]), upper[k])


@njit(cache=True)
def _is_accepted(new_value, value, gradient, point, trial):
    """Returns whether the trial falls far enough along the projected path (Armijo); the first always does."""
    if value == math.inf:
        return True
    promised = 0.0
    for k in range(point.shape[0]):
        promised += gradient[k] * (trial[k] - point[k])
    return new_value <= value + _ARMIJO * promised


@njit(cache=True)
def _is_optimal(point, gradient, lower, upper):
    """Returns whether the projected gradient vanishes."""
    for k in range(point.shape[0]):
        moved = min(max(point[k] - gradient[k], lower[k]), upper[k])
        if abs(moved - point[k]) > _GRADIENT_TOLERANCE:
            return False
    return True


@njit(cache=True)
def _remember(point, trial, gradient, new_gradient, steps, changes, n_pairs, r):
    """Stores the pair (s, y) if it has positive curvature; the start has no predecessor."""
    curvature, size = 0.0, 0.0
    slot = n_pairs[r] % steps.shape[0]
    for k in range(point.shape[0]):
        s, y = trial[k] - point[k], new_gradient[k] - gradient[k]
        curvature += s * y
        size += y * y
    if curvature <= 1e-12 * size:
        return
    for k in range(point.shape[0]):
        steps[slot, k] = trial[k] - point[k]
        changes[slot, k] = new_gradient[k] - gradient[k]
    n_pairs[r] += 1


@njit(cache=True)
def _aim(point, gradient, lower, upper, steps, changes, n_pairs, direction):
    """Fills the quasi-Newton direction on the free variables; those held at a bound stay."""
    d = point.shape[0]
    free = np.empty(d)
    for k in range(d):
        at_lower = point[k] <= lower[k] and gradient[k] > 0.0
        at_upper = point[k] >= upper[k] and gradient[k] < 0.0
        free[k] = 0.0 if at_lower or at_upper else 1.0
        direction[k] = -gradient[k] * free[k]
    _two_loops(free, steps, changes, n_pairs, direction)
    slope = 0.0
    for k in range(d):
        direction[k] *= free[k]
        slope += direction[k] * gradient[k]
    if slope >= 0.0:
        for k in range(d):
            direction[k] = -gradient[k] * free[k]


@njit(cache=True)
def _two_loops(free, steps, changes, n_pairs, direction):
    """Multiplies `direction` by the inverse Hessian that the stored pairs imply on the free variables."""
    memory = steps.shape[0]
    shares = np.zeros(memory)
    curvatures = np.zeros(memory)
    scale = 1.0
    oldest = max(0, n_pairs - memory)
    for pair in range(n_pairs - 1, oldest - 1, -1):
        m = pair % memory
        curvatures[m], size = _curvature(free, steps[m], changes[m])
        if curvatures[m] <= 1e-12 * size:
            continue
        if scale == 1.0:
            scale = curvatures[m] / size
        shares[m] = _dot(steps[m], direction, free) / curvatures[m]
        for k in range(direction.shape[0]):
            direction[k] -= shares[m] * changes[m, k] * free[k]
    for k in range(direction.shape[0]):
        direction[k] *= scale
    for pair in range(oldest, n_pairs):
        m = pair % memory
        if shares[m] == 0.0:
            continue
        correction = shares[m] - _dot(changes[m], direction, free) / curvatures[m]
        for k in range(direction.shape[0]):
            direction[k] += correction * steps[m, k] * free[k]


@njit(cache=True)
def _curvature(free, s, y):
    """Returns s . y and y . y on the free variables."""
    curvature, size = 0.0, 0.0
    for k in range(s.shape[0]):
        curvature += s[k] * y[k] * free[k]
        size += y[k] * y[k] * free[k]
    return curvature, size


@njit(cache=True)
def _dot(a, b, free):
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * b[k] * free[k]
    return total


@njit(cache=True)
def _first_step(direction, lower, upper):
    """Returns the step that goes half a diagonal of the bounds, before any curvature is known.

    The objective has many local optima; a long first step, shortened if it doesn't pay, leaves the nearest poor one.
    """
    return 0.5 * _norm(upper - lower) / _norm(direction)


@njit(cache=True)
def _norm(vector):
    return math.sqrt((vector * vector).sum())
