"""The best pair of all that can be driven: both drives' controls climb together, from random starts.

An objective of psi = Phi(A) - Phi(B) has the slope g in psi. By the chain rule its slope in A's controls is that of
the reward g . Phi(A), and in B's that of -g . Phi(B): a domain that can differentiate rewards can differentiate any
such objective.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from study_core import lbfgs
from study_core.acquisition.pairs import Climbed, Objective, RankedTrajectories
from study_core.domain import Domain
from study_core.posterior.run import Posterior

# As many as the paper gives each trajectory.
_N_STARTS = 10

# The last percent of the objective would take twenty times as long.
_MAX_EVALUATIONS = 100


def climb_pairs(
    rng: np.random.Generator, domain: Domain, climbed: Climbed, posterior: Posterior
) -> RankedTrajectories:
    """Returns the pairs that the climbs end at, best first.

    Args:
        rng: Draws the starts, uniform within the bounds.
        domain: Supplies features and gradients.
        climbed: What is climbed, and what the pairs are ranked by.
        posterior: What is known.
    """
    lower, upper = np.tile(domain.control_lower, 2), np.tile(domain.control_upper, 2)
    starts = rng.uniform(lower, upper, (_N_STARTS, len(lower)))
    objective = climbed.objective(posterior)

    def evaluate(
        points: Float[np.ndarray, "n n_both"], rows: Int[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_both"]]:
        return values_and_gradients(domain, objective, points)

    points, values, has_converged, _ = lbfgs.climb(evaluate, starts, lower, upper, _MAX_EVALUATIONS)
    scores = values if climbed.ranked_by is None else climbed.ranked_by(posterior, _psis(domain, points))
    best = np.argsort(-scores, kind="stable")
    controls = points[best].reshape(len(points), 2, -1)
    return RankedTrajectories(controls, None, scores[best], has_converged[best])


def values_and_gradients(
    domain: Domain, objective: Objective, points: Float[np.ndarray, "n n_both"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_both"]]:
    """Returns an objective of psi and its gradient in the controls of both drives.

    Args:
        domain: Supplies features and gradients.
        objective: Of psi.
        points: Controls of A, then of B, of each pair.
    """
    values, slopes = objective(_psis(domain, points))
    both = np.stack([slopes, -slopes], axis=1).reshape(-1, slopes.shape[1])
    _, gradients = domain.reward_and_gradient(points.reshape(len(both), -1), both)
    return values, gradients.reshape(points.shape)


def _psis(domain: Domain, points: Float[np.ndarray, "n n_both"]) -> Float[np.ndarray, "n n_features"]:
    features = domain.features(domain.rollout(points.reshape(2 * len(points), -1)))
    return features[0::2] - features[1::2]
