"""Uniform priors over nonnegative weights, and the coordinates in which they are close to a standard normal.

`ball`: uniform on {w >= 0, |w| <= 1}, the paper's. `sphere`: uniform on {w >= 0, |w| = 1}: with a rationality of its
own, the length of w says nothing.

The direction of w has d - 1 angles, w_1 = cos a_1, w_2 = sin a_1 cos a_2, ..., each from 0 to pi/2, and each has a
coordinate z with a = (pi / 2) Phi(z): the whole line, on which a uniform angle is standard normal. Under the uniform
prior the angles' density is the product of sin(a_k)^(d - 1 - k). On the ball, the length has a coordinate of its own,
|w|^d = Phi(z). Without bounds and with light tails, a mixture of a few Student's t distributions fits what the answers
leave, even where a weight may be 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri

from study_core.posterior import kernels
from study_core.posterior.population import PopulationPrior

Support = Literal["ball", "sphere"]
KERNEL_SUPPORTS: dict[Support, int] = {"ball": kernels.BALL, "sphere": kernels.SPHERE}


@dataclass(frozen=True)
class Prior:
    """A uniform prior over nonnegative weights.

    Attributes:
        support: `ball` or `sphere`.
        n_features: Length of w, at least 2.
        population: What the people before care for, in the place of the uniform prior; only on the sphere and with an
            inferred rationality, whose prior it replaces as well.
    """

    support: Support
    n_features: int
    population: PopulationPrior | None = None

    @property
    def kernel_support(self) -> int:
        """Returns the support's number in `kernels`."""
        return KERNEL_SUPPORTS[self.support]

    @property
    def n_coordinates(self) -> int:
        """Returns how many coordinates stand for w."""
        return self.n_features - 1 if self.support == "sphere" else self.n_features

    @property
    def log_normaliser(self) -> float:
        """Returns what `kernels.log_prior` leaves out: the logarithm of its integral over all coordinates."""
        # The integral of sin^m from 0 to pi/2 is sqrt(pi)/2 Gamma((m + 1) / 2) / Gamma(m / 2 + 1).
        powers = range(self.n_features - 1)
        angles = (
            0.5 * math.log(math.pi) - math.log(2.0) + math.lgamma((m + 1) / 2) - math.lgamma(m / 2 + 1)
            for m in powers
        )
        normals = 0.5 * self.n_coordinates * math.log(2.0 * math.pi)
        return math.fsum(angles) - len(powers) * math.log(math.pi / 2.0) + normals

    def draw(self, rng: np.random.Generator, n: int) -> Float[np.ndarray, "n n_features"]:
        """Returns n independent weight vectors, shape `(n, n_features)`."""
        directions = np.abs(rng.standard_normal((n, self.n_features)))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        if self.support == "sphere":
            return directions
        return directions * rng.random((n, 1)) ** (1.0 / self.n_features)

    def coordinates(self, weights: Float[np.ndarray, "n n_features"]) -> Float[np.ndarray, "n n_coordinates"]:
        """Returns the coordinates of each weight vector; every weight must be positive."""
        remaining = np.sqrt(np.cumsum(weights[:, ::-1] ** 2, axis=1)[:, ::-1])
        angles = np.arctan2(remaining[:, 1:], weights[:, :-1])
        coordinates = ndtri(angles / (0.5 * np.pi))
        if self.support == "sphere":
            return np.ascontiguousarray(coordinates)
        length = ndtri(remaining[:, :1] ** self.n_features)
        return np.hstack([coordinates, length])

    def weights(self, coordinates: Float[np.ndarray, "n n_coordinates"]) -> Float[np.ndarray, "n n_features"]:
        """Returns the weight vector of each row of coordinates."""
        weights: Float[np.ndarray, "n n_features"] = kernels.all_weights(
            self.kernel_support, self.n_features, np.ascontiguousarray(coordinates)
        )
        return weights
