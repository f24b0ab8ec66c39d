"""What a person's reward may be: the features that it is linear in, and what is believed of their weights."""

from __future__ import annotations

from dataclasses import dataclass

from study_core.bank import Bank
from study_core.domain import Domain
from study_core.posterior.prior import Prior


@dataclass(frozen=True)
class Rewards:
    """What posteriors and queries run over.

    Attributes:
        domain: Gives the features of trajectories; a learned feature is one of them, the last.
        prior: Over the weights of these features.
        bank: The domain's bank of local optima; None if the study has no use for one.
    """

    domain: Domain
    prior: Prior
    bank: Bank | None
