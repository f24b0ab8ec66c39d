"""What a session knows beyond its study file: what the people before taught, and what its own answers have."""

from __future__ import annotations

from dataclasses import dataclass

from study_core.comparison import ComparisonSet
from study_core.domain import Domain
from study_core.online.feature import Compared, LearnedFeature
from study_core.posterior.population import PopulationPrior


@dataclass(frozen=True)
class Knowledge:
    """What the posterior and the queries of one session rest on, besides the study file and the answers.

    Attributes:
        population: What the people before care for; None for a session that starts from the study file's prior alone.
        feature: What the hand-coded features miss, learned from the session's own answers; None before that.
    """

    population: PopulationPrior | None = None
    feature: LearnedFeature | None = None

    def add_to(self, domain: Domain, comparisons: ComparisonSet, compared: Compared | None) -> ComparisonSet:
        """Returns a session's answers in the features that it goes on with.

        Args:
            domain: Whose trajectories were compared.
            comparisons: The answers in the hand-coded features.
            compared: The same with what they compared; needed once a feature has been learned.
        """
        if self.feature is None:
            return comparisons
        assert compared is not None, "a learned feature looks at what was compared"
        return self.feature.added_to(domain, compared)

    @property
    def digest(self) -> str:
        """Returns what names it: equal knowledge has equal digests."""
        parts = (self.population, self.feature)
        return " ".join("nothing" if part is None else part.digest for part in parts)


NOTHING = Knowledge()
