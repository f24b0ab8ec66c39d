"""Answers of somebody who prefers by utility, and at times presses either button whatever is shown.

    P(answer) = lapse / 2 + (1 - lapse) sigmoid(z),    z = utility of what was preferred - utility of the other

The derivatives of log P in z and in a = logit(lapse) are short in terms of how likely it is that the answer was no
lapse, rho = (1 - lapse) sigmoid(z) / P, because logit(rho) = log sigmoid(z) - a + log 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import expit, log_expit

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(32)


@dataclass(frozen=True)
class LogLikelihood:
    """log P of each answer, and its derivatives, all of the shape of z.

    Attributes:
        value: log P.
        slope: Its first derivative in z.
        curvature: Its second; positive where the answer looks like a lapse.
        third: Its third.
        lapse_slope: Its derivative in a.
        lapse_slope_of_slope: The derivative of `slope` in a.
        lapse_slope_of_curvature: The derivative of `curvature` in a.
    """

    value: Float[np.ndarray, "..."]
    slope: Float[np.ndarray, "..."]
    curvature: Float[np.ndarray, "..."]
    third: Float[np.ndarray, "..."]
    lapse_slope: Float[np.ndarray, "..."]
    lapse_slope_of_slope: Float[np.ndarray, "..."]
    lapse_slope_of_curvature: Float[np.ndarray, "..."]


def log_likelihood(z: Float[np.ndarray, "..."], lapse_logit: float) -> LogLikelihood:
    """Returns the log likelihood of answers.

    Args:
        z: By how much the utility of what was preferred exceeds that of the other, any shape.
        lapse_logit: a, the logit of the lapse rate.
    """
    lapse = expit(lapse_logit)
    lapsed, meant = np.log(lapse / 2), np.log1p(-lapse) + log_expit(z)
    rho, sigma, tau = expit(meant - lapsed), expit(z), expit(-z)
    slope = rho * tau
    bend = (1 - rho) * tau - sigma
    return LogLikelihood(
        value=np.logaddexp(lapsed, meant),
        slope=slope,
        curvature=slope * bend,
        third=slope * (bend**2 - tau * (rho * (1 - rho) * tau + (2 - rho) * sigma)),
        lapse_slope=1 - rho - lapse,
        lapse_slope_of_slope=-(1 - rho) * slope,
        lapse_slope_of_curvature=-(1 - rho) * slope * ((1 - 2 * rho) * tau - sigma),
    )


def expected_information(z: Float[np.ndarray, "..."], lapse_logit: float) -> Float[np.ndarray, "..."]:
    """Returns what an answer is expected to tell about z, E[slope^2] over both answers; never negative."""
    lapse = expit(lapse_logit)
    slope_of_p = (1 - lapse) * expit(z) * expit(-z)
    p = lapse / 2 + (1 - lapse) * expit(z)
    return slope_of_p**2 / (p * (1 - p))


def probability(
    means: Float[np.ndarray, " n"], variances: Float[np.ndarray, " n"], lapse_logit: float
) -> Float[np.ndarray, " n"]:
    """Returns how likely A is preferred when all that is known of A's advantage in utility is a normal distribution.

    The integral is Gauss-Hermite quadrature with 32 nodes.

    Args:
        means: Of each pair's advantage, shape `(n,)`.
        variances: Of each pair's advantage, shape `(n,)`.
        lapse_logit: a, the logit of the lapse rate.
    """
    lapse = expit(lapse_logit)
    z = means[:, None] + np.sqrt(variances)[:, None] * _NODES
    return lapse / 2 + (1 - lapse) * (expit(z) @ _WEIGHTS) / _WEIGHTS.sum()
