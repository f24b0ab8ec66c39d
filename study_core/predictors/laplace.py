"""Laplace's approximation of what answers tell about people who resemble each other.

Person u answers by the utility w_u . feature difference, with lapses (`study_core.predictors.lapsing`), and

    w_0 ~ N(mean, precision^-1),    w_u ~ N(w_0, I / personal_precision)

The normal distribution is around the mode. Its precision is the prior's plus each answer's information. That is the
Hessian but for answers that look like lapses, which bend the other way and count for nothing: with them, the Hessian
may be close to singular, and the evidence as large as one likes.

A mode is nearer to zero than the mean, the more so the fewer the answers and the more the lapses: the scales and the
lapse rate that the evidence favours are then too small, and the intervals too narrow (see DECISIONS.md).

Both matrices are arrows: one block for each person, joined by the shared w_0 alone. So they are inverted person by
person; the cost is linear in the number of people.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from study_core.predictors.lapsing import LogLikelihood, log_likelihood

_MOST_STEPS = 100
# A step is halved until it brings this share of the rise that its slope promises, and given up at the shortest.
_LEAST_SHARE_OF_RISE = 1e-4
_SHORTEST_STEP = 1e-6
# Where Newton's step promises less log posterior than this, it is the last, and squares what error is left.
_SMALLEST_RISE = 1e-10


@dataclass(frozen=True)
class Gaussian:
    """A normal distribution of weights.

    Attributes:
        mean: Shape `(k,)`.
        covariance: Shape `(k, k)`.
    """

    mean: Float[np.ndarray, " k"]
    covariance: Float[np.ndarray, "k k"]


@dataclass(frozen=True)
class Prior:
    """What is believed before any answer.

    Attributes:
        mean: Of the shared weights w_0, shape `(k,)`.
        precision: Of the shared weights, the inverse of their covariance, shape `(k, k)`.
        personal_precision: 1 / s_1^2, the same for every weight.
        lapse_logit: Logit of everybody's lapse rate.
    """

    mean: Float[np.ndarray, " k"]
    precision: Float[np.ndarray, "k k"]
    personal_precision: float
    lapse_logit: float


@dataclass(frozen=True)
class Weights:
    """A point of the posterior.

    Attributes:
        shared: w_0, shape `(k,)`.
        personal: w_u of each person, shape `(n_people, k)`.
    """

    shared: Float[np.ndarray, " k"]
    personal: Float[np.ndarray, "n_people k"]


@dataclass(frozen=True)
class Covariances:
    """Inverse of the arrow, as blocks.

    Attributes:
        shared: Covariance of w_0, shape `(k, k)`.
        given_shared: Covariance of each w_u if w_0 were known, shape `(n_people, k, k)`.
        personal_precision: As in the prior.
        log_determinant: Of the arrow.
    """

    shared: Float[np.ndarray, "k k"]
    given_shared: Float[np.ndarray, "n_people k k"]
    personal_precision: float
    log_determinant: float

    def times(self, vector: Weights) -> Weights:
        """Returns the inverse of the arrow, times a vector."""
        through = vector.shared + self.personal_precision * _products(self.given_shared, vector.personal).sum(
            axis=0
        )
        shared = self.shared @ through
        return Weights(
            shared, _products(self.given_shared, vector.personal + self.personal_precision * shared)
        )

    @property
    def personal(self) -> Float[np.ndarray, "n_people k k"]:
        """Covariance of each w_u, shape `(n_people, k, k)`."""
        gain = self.personal_precision * self.given_shared
        return self.given_shared + gain @ self.shared @ gain

    @property
    def deviations(self) -> Float[np.ndarray, "n_people k k"]:
        """Covariance of each w_u - w_0, shape `(n_people, k, k)`."""
        loss = np.eye(len(self.shared)) - self.personal_precision * self.given_shared
        return self.given_shared + loss @ self.shared @ loss.transpose(0, 2, 1)


@dataclass(frozen=True)
class Posterior:
    """A normal distribution around the mode.

    Attributes:
        mode: Where the log posterior is highest.
        likelihood: Of every answer at the mode, shapes `(n_people, n)`.
        covariances: Of the normal distribution.
        inverse_hessian: Inverse of the Hessian of -log posterior, which says how the mode moves; the covariances once
            more where the Hessian isn't definite.
        log_density: At the mode: log likelihood less that of tossing a coin, plus log prior without its normaliser.
        has_converged: Whether this is a mode; if not, climbing gave up on the way to it.
    """

    mode: Weights
    likelihood: LogLikelihood
    covariances: Covariances
    inverse_hessian: Covariances
    log_density: float
    has_converged: bool

    def of_shared(self) -> Gaussian:
        """Returns the distribution of w_0."""
        return Gaussian(self.mode.shared, self.covariances.shared)

    def of_person(self, u: int) -> Gaussian:
        """Returns the distribution of w_u."""
        return Gaussian(self.mode.personal[u], self.covariances.personal[u])


def approximate(
    prior: Prior, signed_diffs: Float[np.ndarray, "n_people n k"], start: Weights | None = None
) -> Posterior:
    """Climbs to the mode by Newton's method.

    Args:
        prior: What is believed before.
        signed_diffs: Features of what was preferred less those of the other, shape `(n_people, n, k)`. Rows of zeros
            say nothing: they make up for people with fewer answers.
        start: Where to start to climb; the prior mean unless given.
    """
    point = start or Weights(prior.mean, np.tile(prior.mean, (len(signed_diffs), 1)))
    for _ in range(_MOST_STEPS):
        here = _posterior_at(prior, signed_diffs, point)
        gradient = _gradient(prior, signed_diffs, here)
        step = here.inverse_hessian.times(gradient)
        rise = float(gradient.shared @ step.shared + (gradient.personal * step.personal).sum())
        if rise < _SMALLEST_RISE:
            return _posterior_at(prior, signed_diffs, _moved(point, step, 1.0))
        size = _step_size(prior, signed_diffs, here, step, rise)
        if size < _SHORTEST_STEP:
            break
        point = _moved(point, step, size)
    return replace(here, has_converged=False)


def _posterior_at(prior: Prior, signed_diffs: Float[np.ndarray, "n_people n k"], point: Weights) -> Posterior:
    """Returns the normal distribution around a point; where the Hessian isn't definite, this is no mode."""
    z = _products(signed_diffs, point.personal)
    likelihood = log_likelihood(z, prior.lapse_logit)
    covariances = _covariances(prior, signed_diffs, likelihood.information)
    try:
        inverse_hessian, is_definite = _covariances(prior, signed_diffs, -likelihood.curvature), True
    except np.linalg.LinAlgError:
        inverse_hessian, is_definite = covariances, False
    log_density = _log_density(prior, signed_diffs, point)
    return Posterior(point, likelihood, covariances, inverse_hessian, log_density, is_definite)


def _covariances(
    prior: Prior,
    signed_diffs: Float[np.ndarray, "n_people n k"],
    informations: Float[np.ndarray, "n_people n"],
) -> Covariances:
    """Inverts the arrow; raises `LinAlgError` where it isn't positive definite."""
    n_people, _, k = signed_diffs.shape
    tau, identity = prior.personal_precision, np.eye(k)
    told = signed_diffs.transpose(0, 2, 1) @ (informations[:, :, None] * signed_diffs)
    given_shared, log_determinants = _inverse(told + tau * identity)
    shared_precision = prior.precision + n_people * tau * identity - tau**2 * given_shared.sum(axis=0)
    shared, log_determinant = _inverse(shared_precision)
    return Covariances(shared, given_shared, tau, float(log_determinant + log_determinants.sum()))


def _inverse(
    matrices: Float[np.ndarray, "*batch k k"],
) -> tuple[Float[np.ndarray, "*batch k k"], Float[np.ndarray, "*batch"]]:
    """Returns inverses and log determinants; raises `LinAlgError` where a matrix isn't positive definite."""
    diagonals = np.diagonal(np.linalg.cholesky(matrices), axis1=-2, axis2=-1)
    return np.linalg.inv(matrices), np.asarray(2.0 * np.log(diagonals).sum(axis=-1))


def _log_density(prior: Prior, signed_diffs: Float[np.ndarray, "n_people n k"], point: Weights) -> float:
    likelihood = log_likelihood(_products(signed_diffs, point.personal), prior.lapse_logit)
    offset, deviations = point.shared - prior.mean, point.personal - point.shared
    squares = offset @ prior.precision @ offset + prior.personal_precision * (deviations**2).sum()
    return float((likelihood.value + np.log(2.0)).sum() - squares / 2)


def _gradient(prior: Prior, signed_diffs: Float[np.ndarray, "n_people n k"], here: Posterior) -> Weights:
    """Returns the gradient of the log posterior."""
    pulls = prior.personal_precision * (here.mode.personal - here.mode.shared)
    shared = pulls.sum(axis=0) - prior.precision @ (here.mode.shared - prior.mean)
    return Weights(shared, sums_over_answers(signed_diffs, here.likelihood.slope) - pulls)


def _step_size(
    prior: Prior, signed_diffs: Float[np.ndarray, "n_people n k"], here: Posterior, step: Weights, rise: float
) -> float:
    size = 1.0
    while size >= _SHORTEST_STEP:
        there = _log_density(prior, signed_diffs, _moved(here.mode, step, size))
        if there >= here.log_density + _LEAST_SHARE_OF_RISE * size * rise:
            break
        size /= 2
    return size


def _moved(point: Weights, step: Weights, size: float) -> Weights:
    return Weights(point.shared + size * step.shared, point.personal + size * step.personal)


def sums_over_answers(
    diffs: Float[np.ndarray, "n_people n k"], factors: Float[np.ndarray, "n_people n"]
) -> Float[np.ndarray, "n_people k"]:
    """Returns the sum of each person's feature differences, each times its own factor."""
    return (factors[:, None, :] @ diffs)[:, 0]


def _products(
    matrices: Float[np.ndarray, "n_people m k"], vectors: Float[np.ndarray, "n_people k"]
) -> Float[np.ndarray, "n_people m"]:
    return (matrices @ vectors[:, :, None])[:, :, 0]
