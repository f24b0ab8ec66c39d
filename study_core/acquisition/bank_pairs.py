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


def ranked_drives(
    bank: Bank, pairs: Int[np.ndarray, "n_pairs 2"], scores: Float[np.ndarray, " n_pairs"]
) -> RankedTrajectories:
    """Returns pairs of rows of the bank, best first already, with what is known of the drives: all are optima."""
    return RankedTrajectories(
        bank.controls[pairs], bank.weights[pairs], scores, np.ones(len(pairs), dtype=bool)
    )
