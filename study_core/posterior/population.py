"""What people before somebody care for, as a prior: a normal distribution of the utilities u = beta w.

The answers know beta and w by their product alone, so that is what people have in common. With w on the nonnegative
sphere and beta its length, u is any nonnegative vector, and the prior is the normal distribution cut off where a
utility would be negative.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class PopulationPrior:
    """A normal distribution of u = beta w, before it is cut off at 0.

    Attributes:
        mean: Shape `(n_features,)`.
        covariance: Positive definite, shape `(n_features, n_features)`.
    """

    mean: Float[np.ndarray, " n_features"]
    covariance: Float[np.ndarray, "n_features n_features"]

    @property
    def precision(self) -> Float[np.ndarray, "n_features n_features"]:
        """Returns the inverse of the covariance, symmetric to the last bit."""
        inverse = np.linalg.inv(self.covariance)
        return np.ascontiguousarray(0.5 * (inverse + inverse.T))

    @property
    def digest(self) -> str:
        """Returns the SHA-256 of its numbers, in hex."""
        return hashlib.sha256(self.mean.tobytes() + self.covariance.tobytes()).hexdigest()
