"""Uniform priors over nonnegative weights, and the coordinates in which the sampler moves.

`ball`: uniform on {w >= 0, |w| <= 1}, the paper's. The coordinates are w itself.

`sphere`: uniform on {w >= 0, |w| = 1}: with a rationality of its own, the length of w says nothing. The
coordinates are the first d - 1 entries of s = w / sum(w), which fill a simplex; projecting the sphere on it from
the origin (the gnomonic projection) turns the uniform density into one proportional to |s|^-d.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from study_core.posterior import kernels

Support = Literal["ball", "sphere"]
KERNEL_SUPPORTS: dict[Support, int] = {"ball": kernels.BALL, "sphere": kernels.SPHERE}


@dataclass(frozen=True)
class Prior:
    """A uniform prior over nonnegative weights.

    Attributes:
        support: `ball` or `sphere`.
        n_features: Length of w.
    """

    support: Support
    n_features: int

    @property
    def kernel_support(self) -> int:
        """Returns the support's number in `kernels`."""
        return KERNEL_SUPPORTS[self.support]

    @property
    def n_coordinates(self) -> int:
        """Returns how many free coordinates the sampler moves in."""
        return self.n_features - 1 if self.support == "sphere" else self.n_features

    def draw(self, rng: np.random.Generator, n: int) -> Float[np.ndarray, "n n_features"]:
        """Returns n independent weight vectors, shape `(n, n_features)`."""
        directions = np.abs(rng.standard_normal((n, self.n_features)))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        if self.support == "sphere":
            return directions
        return directions * rng.random((n, 1)) ** (1.0 / self.n_features)

    def coordinates(self, weights: Float[np.ndarray, "n n_features"]) -> Float[np.ndarray, "n n_coordinates"]:
        """Returns the sampler's coordinates of each weight vector."""
        if self.support == "sphere":
            return weights[:, :-1] / weights.sum(axis=1, keepdims=True)
        return weights

    def weights(self, coordinates: Float[np.ndarray, "n n_coordinates"]) -> Float[np.ndarray, "n n_features"]:
        """Returns the weight vector of each row of coordinates."""
        if self.support == "ball":
            return coordinates
        simplex = _simplex(coordinates)
        lengths: Float[np.ndarray, "n 1"] = np.linalg.norm(simplex, axis=1, keepdims=True)
        return simplex / lengths

    def log_density(self, coordinates: Float[np.ndarray, "n n_coordinates"]) -> Float[np.ndarray, " n"]:
        """Returns the log prior density in the sampler's coordinates, up to a constant, for points inside."""
        if self.support == "ball":
            return np.zeros(len(coordinates))
        return -self.n_features * np.log(np.linalg.norm(_simplex(coordinates), axis=1))


def _simplex(coordinates: Float[np.ndarray, "n n_coordinates"]) -> Float[np.ndarray, "n n_features"]:
    """Returns s = w / sum(w) from its first entries."""
    return np.hstack([coordinates, 1.0 - coordinates.sum(axis=1, keepdims=True)])
