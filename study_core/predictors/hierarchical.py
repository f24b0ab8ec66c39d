"""Hierarchical Bayes over the rich features that a domain declares: everybody a little unlike everybody else.

Every feature has a weight that people share, and each person deviates from it (`study_core.predictors.hierarchy`).
"""

from __future__ import annotations

from collections.abc import Mapping

from study_core.domain import Domain
from study_core.predictors.linear_people import LinearPeople, learn_people
from study_core.predictors.predictor import Training


class Hierarchical:
    """A `Predictor`.

    Attributes:
        name: `hierarchical`.
    """

    name = "hierarchical"

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> LinearPeople:
        """Learns from everyone's active answers; nothing about it is random.

        Args:
            seed: Not needed.
            domain: Gives the rich features.
            people: Active answers by person; somebody may have given none.

        Raises:
            TooFewAnswersError: Nobody has given an answer.
        """
        return learn_people(domain.rich_features, people)
