"""Random pairs of posterior samples: the baseline that every active method is measured against."""

from __future__ import annotations

import numpy as np

from study_core.acquisition.pairs import RankedPairs
from study_core.posterior.run import Posterior

VERSION = "random-1"


def rank_pairs(rng: np.random.Generator, posterior: Posterior, mu: float, n_pairs: int) -> RankedPairs:
    """Returns different pairs in random order, all with score 0; `mu` has no part in it."""
    first, second = np.triu_indices(len(posterior.samples), k=1)
    chosen = rng.choice(len(first), size=min(n_pairs, len(first)), replace=False)
    return RankedPairs(np.column_stack([first[chosen], second[chosen]]), np.zeros(len(chosen)))
