"""What a session knows beyond its study file: what the people before taught, and what its own answers have."""

from __future__ import annotations

from dataclasses import dataclass

from study_core.online.feature import LearnedFeature
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

    @property
    def digest(self) -> str:
        """Returns what names it: equal knowledge has equal digests."""
        parts = (self.population, self.feature)
        return " ".join("nothing" if part is None else part.digest for part in parts)


NOTHING = Knowledge()
