"""Intervals of means over people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.streams import stream


@dataclass(frozen=True)
class Mean:
    """A mean over people.

    Attributes:
        value: The mean.
        low: Lower end of its 95 % interval, people resampled.
        high: Upper end.
    """

    value: float
    low: float
    high: float


def mean_over_people(seed: int, values: Sequence[float]) -> Mean:
    """Returns a mean with its percentile interval; people are drawn anew with replacement (Efron 1979).

    The same people are drawn for equal seeds and numbers of people, so that differences of means are as certain as
    they should be.

    Args:
        seed: Names the stream of the resampling.
        values: One for each person, at least one.
    """
    array = np.asarray(values, dtype=np.float64)
    low, high = bootstrap_interval(stream(seed, "people-resampled"), array)
    return Mean(float(array.mean()), low, high)


def bootstrap_interval(
    rng: np.random.Generator, values: Float[np.ndarray, " n_people"], n_resamples: int = 20_000
) -> tuple[float, float]:
    """Returns the 95 % percentile interval of the mean over people, who are drawn anew with replacement."""
    rows = rng.integers(len(values), size=(n_resamples, len(values)))
    low, high = np.percentile(values[rows].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)
