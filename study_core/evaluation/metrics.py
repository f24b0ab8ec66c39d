"""Scores of predictions against the answers that people gave."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from study_core.comparison import ComparisonSet


def accuracy(weights: Float[np.ndarray, " n_features"], comparisons: ComparisonSet) -> float:
    """Returns the share of answers that the sign of w . psi predicts; a tie counts half.

    Args:
        weights: w, shape `(n_features,)`.
        comparisons: The answers to predict.

    Raises:
        ValueError: There are no answers, so there is no share.
    """
    if len(comparisons) == 0:
        raise ValueError(
            "Expected at least one answer to predict, got none. Leave out people without answers."
        )
    agreement = np.sign(comparisons.preferred_diffs @ weights)
    return float(np.mean((1.0 + agreement) / 2.0))
