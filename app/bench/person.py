"""A simulated person: known weights, answers by the study's own response model."""

from __future__ import annotations

import numpy as np

from study_core.comparison import Choice, Query
from study_core.streams import stream
from study_core.study import Study


class Person:
    """Someone whose answers are a sigmoid of a reward that only they know."""

    def __init__(self, study: Study, seed: int, number: int) -> None:
        """Draws the weights from the study's prior.

        Args:
            study: Supplies prior and response model.
            seed: Of the measurement.
            number: Tells people apart.
        """
        self._response = study.response
        self._rng = stream(seed, "bench-person", number)
        self.weights = study.prior.draw(self._rng, 1)[0]

    def choose(self, query: Query) -> Choice:
        """Returns the drive that this person prefers."""
        reward_diff = np.asarray(query.feature_diff @ self.weights)
        return Choice.A if self._rng.random() < self._response.probability_of_a(reward_diff) else Choice.B
