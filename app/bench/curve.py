"""A measure over the course of a session, averaged over people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study_core.streams import stream

_N_RESAMPLES = 2000


@dataclass(frozen=True)
class Curve:
    """The mean over people after 0, 1, ... answers; each of shape `(n_queries + 1,)`.

    Attributes:
        mean: Over people.
        low: Lower end of its 95 % interval, people resampled.
        high: Upper end.
    """

    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray


Curves = dict[str, dict[str, Curve]]
"""By method, then by measure."""


def over_people(values: np.ndarray) -> Curve:
    """Returns the mean of `(n_people, n_queries + 1)` values, and how far it varies with who the people are.

    The interval is the bootstrap's: people drawn again with replacement. Every measure and method draws the same.
    """
    n_people = len(values)
    drawn = stream(0, "bench-bootstrap").integers(n_people, size=(_N_RESAMPLES, n_people))
    shares = np.stack([np.bincount(rows, minlength=n_people) for rows in drawn]) / n_people
    low, high = np.percentile(shares @ values, [2.5, 97.5], axis=0)
    return Curve(values.mean(axis=0), low, high)
