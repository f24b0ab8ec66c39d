"""Random pairs of realistic drives: the baseline that every active method is measured against."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from study_core.acquisition.bank_pairs import bank_of, ranked_drives
from study_core.acquisition.pairs import Acquisition, RankedTrajectories, Situation


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedTrajectories:
    """Returns random pairs of the bank's drives, all with score 0; what has been answered has no part in it."""
    bank = bank_of(situation)
    pairs = _draw_pairs(rng, len(bank.controls), n_pairs)
    return ranked_drives(bank, pairs, np.zeros(len(pairs)))


def _draw_pairs(rng: np.random.Generator, n_drives: int, n_pairs: int) -> Int[np.ndarray, "n_drawn 2"]:
    """Returns random pairs of different rows, the lower first and no pair twice, so it may be a few less.

    Where there are no more pairs than that, it is all of them, in random order.
    """
    if n_drives * (n_drives - 1) // 2 <= n_pairs:
        return rng.permutation(np.column_stack(np.triu_indices(n_drives, k=1)))
    first = rng.integers(n_drives, size=n_pairs)
    second = (first + rng.integers(1, n_drives, size=n_pairs)) % n_drives
    codes = np.minimum(first, second) * n_drives + np.maximum(first, second)
    _, earliest = np.unique(codes, return_index=True)
    return np.column_stack(np.divmod(codes[np.sort(earliest)], n_drives))


RANDOM = Acquisition("random-2", rank_pairs, needs_bank=True)
