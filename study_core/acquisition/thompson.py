"""Thompson sampling for comparisons: two samples of the posterior, each shown at its best.

Both drives are what somebody would want whom the answers so far don't tell from the person (Thompson 1933; for
comparisons, the self-sparring of Sui et al. 2017). As the posterior narrows, the two become alike.
"""

from __future__ import annotations

import numpy as np

from study_core.acquisition.pairs import Acquisition, RankedWeights, Situation


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedWeights:
    """Returns different pairs of samples in random order, all with score 0."""
    samples = situation.posterior.samples
    first, second = np.triu_indices(len(samples), k=1)
    chosen = rng.choice(len(first), size=min(n_pairs, len(first)), replace=False)
    pairs = np.stack([samples[first[chosen]], samples[second[chosen]]], axis=1)
    return RankedWeights(pairs, np.zeros(len(chosen)))


THOMPSON = Acquisition("thompson-1", rank_pairs)
