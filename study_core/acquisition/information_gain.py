"""Information gain over free controls: the two drives, of all that can be driven, whose comparison would say most.

    maximise over both drives' controls    I(answer; w) = H(mean_w p(answer | w)) - mean_w H(p(answer | w))

(Biyik et al. 2019, "Asking Easy Questions", eq. 4, in nats). Nothing makes the drives sensible: they leave the road
and drive backwards (Katz et al. 2021, Fig. 1, left). `information-gain-realistic` is the same over drives that
somebody could want.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from jaxtyping import Float

from study_core.acquisition import kernels
from study_core.acquisition.free_controls import climb_pairs
from study_core.acquisition.pairs import Acquisition, Climbed, RankedTrajectories, Situation
from study_core.posterior.run import Posterior


def information_gains(
    posterior: Posterior, psis: Float[np.ndarray, "n_pairs n_features"]
) -> tuple[Float[np.ndarray, " n_pairs"], Float[np.ndarray, "n_pairs n_features"]]:
    """Returns the information gain of each feature difference, and its slope in it.

    Args:
        posterior: Its samples with their response parameters.
        psis: Phi(A) - Phi(B) of each pair.
    """
    parameters = posterior.parameters
    utilities_per_feature = np.ascontiguousarray((posterior.samples * parameters.rationality[:, None]).T)
    gains, slopes = kernels.information_gains(
        psis, utilities_per_feature, parameters.lapse_rate, parameters.tie_threshold
    )
    return gains, slopes


_CLIMBED = Climbed(lambda posterior: partial(information_gains, posterior))


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedTrajectories:
    """Returns the most informative pairs found; see `study_core.acquisition.pairs.RankFn`."""
    return climb_pairs(rng, situation.domain, _CLIMBED, situation.posterior).best(n_pairs)


INFORMATION_GAIN = Acquisition("information-gain-1", rank_pairs, climbed=_CLIMBED)
