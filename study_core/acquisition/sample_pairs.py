"""Pairs of posterior samples, ranked by a score that each pair has on its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from study_core.acquisition.pairs import RankedWeights

ScoreFn = Callable[[Int[np.ndarray, " n"], Int[np.ndarray, " n"]], Float[np.ndarray, " n"]]
"""Takes the rows i and j of each pair; gives the pairs' scores."""


def rank_sample_pairs(
    samples: Float[np.ndarray, "n_samples n_features"], score: ScoreFn, n_pairs: int
) -> RankedWeights:
    """Returns the pairs i < j of the highest scores; equal scores keep the order of the samples."""
    first, second = np.triu_indices(len(samples), k=1)
    scores = score(first, second)
    best = np.argsort(-scores, kind="stable")[:n_pairs]
    return RankedWeights(np.stack([samples[first[best]], samples[second[best]]], axis=1), scores[best])
