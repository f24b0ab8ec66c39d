"""Pairs of a bank's drives."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from study_core.acquisition.pairs import RankedTrajectories, Situation
from study_core.bank import Bank


def bank_of(situation: Situation) -> Bank:
    """Returns the bank that a method which needs one was given."""
    assert situation.bank is not None, "a method that needs a bank is given one"
    return situation.bank


def draw_pairs(rng: np.random.Generator, n_drives: int, n_pairs: int) -> Int[np.ndarray, "n_drawn 2"]:
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


def ranked_drives(
    bank: Bank, pairs: Int[np.ndarray, "n_pairs 2"], scores: Float[np.ndarray, " n_pairs"]
) -> RankedTrajectories:
    """Returns pairs of rows of the bank, best first already, with what is known of the drives: all are optima."""
    return RankedTrajectories(
        bank.controls[pairs], bank.weights[pairs], scores, np.ones(len(pairs), dtype=bool)
    )
