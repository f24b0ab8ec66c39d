"""A mixture of Student's t distributions, fitted to weighted points: where the next points are looked for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from study_core.posterior import mixture_kernels as kernels

# Tails wide enough for any posterior here, whose coordinates have normal tails, and a whole number for the kernel.
DEGREES_OF_FREEDOM = 6
# Covariances are fitted to normals and widened: a proposal too wide costs little, one too narrow traps the chain.
_INFLATION = 1.2


@dataclass(frozen=True)
class Mixture:
    """A mixture of Student's t distributions with `DEGREES_OF_FREEDOM`.

    Attributes:
        shares: Adding up to 1, shape `(n_components,)`.
        means: Shape `(n_components, n)`.
        factors: Lower Cholesky factor of each component's scale matrix, shape `(n_components, n, n)`.
    """

    shares: Float[np.ndarray, " n_components"]
    means: Float[np.ndarray, "n_components n"]
    factors: Float[np.ndarray, "n_components n n"]

    @cached_property
    def for_kernels(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, int]:
        """Returns the mixture as `mixture_kernels.log_density` takes it."""
        n, degrees = self.means.shape[1], DEGREES_OF_FREEDOM
        log_sizes = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        constant = math.lgamma(0.5 * (degrees + n)) - math.lgamma(0.5 * degrees)
        log_heights = np.log(self.shares) - log_sizes + constant - 0.5 * n * math.log(degrees * math.pi)
        log_scale = float(log_heights.max())
        return (
            np.ascontiguousarray(self.means.T),
            np.ascontiguousarray(np.linalg.inv(self.factors).transpose(1, 2, 0)),
            np.exp(log_heights - log_scale),
            log_scale,
            degrees,
        )

    @classmethod
    def standard(cls, n: int) -> Mixture:
        """Returns one component with mean 0 and the identity as its scale matrix."""
        return cls(np.ones(1), np.zeros((1, n)), np.eye(n)[None])

    def with_share(self, other: Mixture, share: float) -> Mixture:
        """Returns the mixture that draws from another one with a probability `share`."""
        return Mixture(
            np.concatenate([(1.0 - share) * self.shares, share * other.shares]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.factors, other.factors]),
        )

    def log_density(self, points: Float[np.ndarray, "n_points n"]) -> Float[np.ndarray, " n_points"]:
        """Returns the log-density of each row."""
        densities: Float[np.ndarray, " n_points"] = kernels.log_densities(self.for_kernels, points)
        return densities

    def draw(self, rng: np.random.Generator, n_points: int) -> Float[np.ndarray, "n_points n"]:
        """Returns independent draws, shape `(n_points, n)`."""
        component = np.searchsorted(np.cumsum(self.shares)[:-1], rng.random(n_points))
        normals = rng.standard_normal((n_points, self.means.shape[1]))
        # A chi-square variate of 2 m degrees of freedom is twice the sum of m exponential ones.
        exponentials = rng.standard_exponential((n_points, DEGREES_OF_FREEDOM // 2)).mean(axis=1)
        points: Float[np.ndarray, "n_points n"] = kernels.place(
            component, self.means, self.factors, normals / np.sqrt(exponentials)[:, None]
        )
        return points


def fit(
    rng: np.random.Generator,
    points: Float[np.ndarray, "n_points n"],
    point_weights: Float[np.ndarray, " n_points"],
    n_components: int,
    n_rounds: int,
) -> Mixture:
    """Returns a mixture fitted to weighted points by expectation maximisation.

    Args:
        rng: Draws the points where components begin.
        points: Shape `(n_points, n)`.
        point_weights: Nonnegative, shape `(n_points,)`; their size says how many points they are worth.
        n_components: How many components.
        n_rounds: How many rounds of expectation maximisation.
    """
    shares = point_weights / point_weights.sum()
    means = points[rng.choice(len(points), n_components, p=shares)].copy()
    fitted, factors = kernels.fit_normals(points, point_weights, means, n_rounds)
    return Mixture(fitted / fitted.sum(), means, math.sqrt(_INFLATION) * factors)
