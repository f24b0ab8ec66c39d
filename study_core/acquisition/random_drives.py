"""Random pairs of realistic drives: the baseline that every active method is measured against."""

from __future__ import annotations

import numpy as np

from study_core.acquisition.bank_pairs import bank_of, draw_pairs, ranked_drives
from study_core.acquisition.pairs import Acquisition, RankedTrajectories, Situation


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedTrajectories:
    """Returns random pairs of the bank's drives, all with score 0; what has been answered has no part in it."""
    bank = bank_of(situation)
    pairs = draw_pairs(rng, len(bank.controls), n_pairs)
    return ranked_drives(bank, pairs, np.zeros(len(pairs)))


RANDOM = Acquisition("random-2", rank_pairs, needs_bank=True)
