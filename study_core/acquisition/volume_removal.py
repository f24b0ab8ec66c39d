"""Volume removal over free controls: whatever the answer, as much of the posterior as possible is ruled out.

    maximise over both drives' controls    min over answers of    mean over w of 1 - min(1, exp(beta I w . psi))

with I = +1 for A and -1 for B (Sadigh et al. 2017, eq. 8; Biyik and Sadigh 2018). What an answer leaves of a w that
would have given it is all, so two equal drives remove nothing. With the normalised sigmoid in its place, as in later
work, min(m, 1 - m) is largest for two equal drives, and ill-posed (Biyik et al. 2019, Sec. III). Lapses and ties
have no part in it.

The minimum has a kink just where it is largest, so the climb is on the harmonic mean of the two volumes, which is
smooth and within a factor of two; the pairs are ranked by the minimum.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from jaxtyping import Float

from study_core.acquisition import kernels
from study_core.acquisition.free_controls import climb_pairs
from study_core.acquisition.pairs import Acquisition, Climbed, RankedTrajectories, Situation
from study_core.posterior.run import Posterior


def removed_volumes(
    posterior: Posterior, psis: Float[np.ndarray, "n_pairs n_features"]
) -> tuple[Float[np.ndarray, "2 n_pairs"], Float[np.ndarray, "2 n_pairs n_features"]]:
    """Returns the share of volume that the answers A and B remove, and its slopes in psi."""
    utilities_per_feature = np.ascontiguousarray(
        (posterior.samples * posterior.parameters.rationality[:, None]).T
    )
    volumes, slopes = kernels.removed_volumes(psis, utilities_per_feature)
    return volumes, slopes


def harmonic_means(
    posterior: Posterior, psis: Float[np.ndarray, "n n_features"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_features"]]:
    """Returns the harmonic mean of the two shares of volume, and its slope in psi."""
    (a, b), (slopes_a, slopes_b) = removed_volumes(posterior, psis)
    total = np.maximum(a + b, np.finfo(float).tiny)
    shares_a, shares_b = (b / total)[:, None], (a / total)[:, None]
    return 2.0 * a * b / total, 2.0 * (shares_a**2 * slopes_a + shares_b**2 * slopes_b)


_CLIMBED = Climbed(
    objective=lambda posterior: partial(harmonic_means, posterior),
    ranked_by=lambda posterior, psis: removed_volumes(posterior, psis)[0].min(axis=0),
)


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedTrajectories:
    """Returns the pairs found that remove most; see `study_core.acquisition.pairs.RankFn`."""
    return climb_pairs(rng, situation.domain, _CLIMBED, situation.posterior).best(n_pairs)


VOLUME_REMOVAL = Acquisition("volume-removal-1", rank_pairs, climbed=_CLIMBED)
