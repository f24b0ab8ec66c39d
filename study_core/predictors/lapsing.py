"""Answers of somebody who prefers by utility, and at times presses either button whatever is shown.

    P(answer) = lapse / 2 + (1 - lapse) sigmoid(z),    z = utility of what was preferred - utility of the other

Derivatives are in z and in a = logit(lapse). They are short in terms of how likely it is that the answer was no lapse,
rho = (1 - lapse) sigmoid(z) / P, because logit(rho) = log sigmoid(z) - a + log 2.
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
        lapse_slope: Its derivative in a.
        lapse_slope_of_slope: The derivative of `slope` in a.
        information: -curvature, or 0 where that is negative.
        slope_of_information: Its derivative in z.
        lapse_slope_of_information: Its derivative in a.
    """

    value: Float[np.ndarray, "..."]
    slope: Float[np.ndarray, "..."]
    curvature: Float[np.ndarray, "..."]
    lapse_slope: Float[np.ndarray, "..."]
    lapse_slope_of_slope: Float[np.ndarray, "..."]
    information: Float[np.ndarray, "..."]
    slope_of_information: Float[np.ndarray, "..."]
    lapse_slope_of_information: Float[np.ndarray, "..."]


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
    tells = bend < 0
    return LogLikelihood(
        value=np.logaddexp(lapsed, meant),
        slope=slope,
        curvature=slope * bend,
        lapse_slope=1 - rho - lapse,
        lapse_slope_of_slope=-(1 - rho) * slope,
        information=np.where(tells, -slope * bend, 0.0),
        slope_of_information=np.where(
            tells, slope * (tau * (rho * (1 - rho) * tau + (2 - rho) * sigma) - bend**2), 0.0
        ),
        lapse_slope_of_information=np.where(tells, (1 - rho) * slope * ((1 - 2 * rho) * tau - sigma), 0.0),
    )


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
