"""Maximum regret: the two samples that would most regret getting each other's best drive.

    maximise over i != j    p(w_i) p(w_j) (w_i . (Phi*(w_i) - Phi*(w_j)) + w_j . (Phi*(w_j) - Phi*(w_i)))

(Wilde, Kulic and Smith 2020, "Active Preference Learning using Maximum Regret", with the difference of rewards where
they have the ratio of positive costs: rewards may have either sign). p is the likelihood relative to the best sample,
so that the product doesn't vanish. Phi*(w) is the best drive of the bank for w, and that is what is shown.
"""

from __future__ import annotations

import numpy as np

from study_core.acquisition.bank_pairs import bank_of, ranked_drives
from study_core.acquisition.pairs import Acquisition, RankedTrajectories, Situation


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedTrajectories:
    """Returns the pairs of most regret; see `study_core.acquisition.pairs.RankFn`."""
    bank, posterior = bank_of(situation), situation.posterior
    drives = (posterior.samples @ bank.features.T).argmax(axis=1)
    # rewards[i, j] is what w_i makes of the best drive for w_j.
    rewards = posterior.samples @ bank.features[drives].T
    regrets = rewards.diagonal()[:, None] - rewards
    likely = np.exp(posterior.log_densities - posterior.log_densities.max())
    first, second = np.triu_indices(len(drives), k=1)
    scores = (likely[:, None] * likely * (regrets + regrets.T))[first, second]
    best = np.argsort(-scores, kind="stable")
    pairs = np.sort(drives[np.column_stack([first[best], second[best]])], axis=1)
    # Many samples share a best drive; of equal pairs the best-scored is kept.
    kept = np.sort(np.unique(pairs, axis=0, return_index=True)[1])[:n_pairs]
    return ranked_drives(bank, pairs[kept], scores[best[kept]])


REGRET = Acquisition("regret-1", rank_pairs, needs_bank=True)
