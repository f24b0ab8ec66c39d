"""What every acquisition method takes and returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from study_core.posterior.run import Posterior


@dataclass(frozen=True)
class RankedPairs:
    """Pairs of posterior samples, best first.

    Attributes:
        indices: Rows of `Posterior.samples`, i < j, shape `(n_pairs, 2)`.
        scores: Acquisition value of each, falling, shape `(n_pairs,)`.
    """

    indices: Int[np.ndarray, "n_pairs 2"]
    scores: Float[np.ndarray, " n_pairs"]


@runtime_checkable
class Acquisition(Protocol):
    """Ranks pairs of posterior samples by how much asking about them would teach."""

    def __call__(
        self, rng: np.random.Generator, posterior: Posterior, mu: float, n_pairs: int
    ) -> RankedPairs:
        """Returns the best `n_pairs` pairs.

        Args:
            rng: For methods that draw.
            posterior: Samples and their log-likelihoods.
            mu: Weight of the distance between the two samples, for methods that have one.
            n_pairs: How many pairs to rank.
        """
        ...
