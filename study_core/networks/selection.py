"""Which trials are kept: those that predict the validation answers best."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from study_core.networks.training import Trials


def best_trials(trials: Trials, n: int) -> Int[np.ndarray, " n"]:
    """Returns the n trials of the highest validation accuracy, best first (Katz et al. 2021, section IV-D).

    With 30 validation answers many trials are equally accurate; of those, the smaller validation loss goes first.
    Without validation all are equal, and the first n are returned.
    """
    return np.lexsort((trials.validation_losses, -trials.validation_accuracies))[:n]
