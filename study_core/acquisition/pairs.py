"""What every acquisition method takes and returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from study_core.bank import Bank
from study_core.domain import Domain
from study_core.posterior.run import Posterior


@dataclass(frozen=True)
class Situation:
    """Everything a method may look at.

    Attributes:
        domain: The robot task.
        posterior: What the answers so far say about the weights and the response.
        bank: Locally optimal trajectories, for methods that choose among them, else None.
        mu: Weight of the distance between the two samples, for methods that have one.
        min_difference: How far apart the two trajectories must look, in body lengths.
    """

    domain: Domain
    posterior: Posterior
    bank: Bank | None
    mu: float
    min_difference: float


@dataclass(frozen=True)
class RankedWeights:
    """Pairs of weights, best first, each of which has still to be turned into its best trajectory.

    Attributes:
        weights: Shape `(n_pairs, 2, n_features)`.
        scores: Acquisition value of each, falling, shape `(n_pairs,)`.
    """

    weights: Float[np.ndarray, "n_pairs 2 n_features"]
    scores: Float[np.ndarray, " n_pairs"]

    def __len__(self) -> int:
        return len(self.scores)


@dataclass(frozen=True)
class RankedTrajectories:
    """Pairs of trajectories, best first.

    Attributes:
        controls: Shape `(n_pairs, 2, n_controls)`.
        weights: The w that each is a local optimum of, or None if the method optimises something else,
            shape `(n_pairs, 2, n_features)`.
        scores: Acquisition value of each, falling, shape `(n_pairs,)`.
        has_converged: Whether the optimiser met its tolerance, shape `(n_pairs,)`.
    """

    controls: Float[np.ndarray, "n_pairs 2 n_controls"]
    weights: Float[np.ndarray, "n_pairs 2 n_features"] | None
    scores: Float[np.ndarray, " n_pairs"]
    has_converged: Bool[np.ndarray, " n_pairs"]

    def __len__(self) -> int:
        return len(self.scores)

    def best(self, n: int) -> RankedTrajectories:
        """Returns the first n pairs."""
        weights = None if self.weights is None else self.weights[:n]
        return RankedTrajectories(self.controls[:n], weights, self.scores[:n], self.has_converged[:n])


RankedPairs = RankedWeights | RankedTrajectories


@runtime_checkable
class RankFn(Protocol):
    """Ranks pairs by how much asking about them would teach."""

    def __call__(self, rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedPairs:
        """Returns at most `n_pairs` different pairs, best first, and at least one.

        Args:
            rng: For methods that draw.
            situation: What is known.
            n_pairs: How many to rank.
        """
        ...


Objective = Callable[
    [Float[np.ndarray, "n n_features"]], tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_features"]]
]
"""Takes psi = Phi(A) - Phi(B) of each pair; gives values and slopes in psi."""


@dataclass(frozen=True)
class Climbed:
    """What a method looks for among all pairs that can be driven.

    Attributes:
        objective: What is climbed, smooth.
        ranked_by: What the pairs found are ranked by, of their psi, if not the objective.
    """

    objective: Callable[[Posterior], Objective]
    ranked_by: Callable[[Posterior, Float[np.ndarray, "n n_features"]], Float[np.ndarray, " n"]] | None = None

    def scores(
        self, posterior: Posterior, psis: Float[np.ndarray, "n n_features"]
    ) -> Float[np.ndarray, " n"]:
        """Returns what pairs are ranked by, of their psi."""
        return (
            self.objective(posterior)(psis)[0] if self.ranked_by is None else self.ranked_by(posterior, psis)
        )


@dataclass(frozen=True)
class Acquisition:
    """A method of choosing the next pair.

    Attributes:
        version: Changed numbers are a new version, recorded with every query.
        rank_pairs: The method.
        needs_bank: Whether it chooses among the trajectories of a bank.
        climbed: What it climbs, if its pairs are where climbs over free controls end; None if it ranks a list of pairs,
            so that the ranking of the same samples is the same on every machine.
    """

    version: str
    rank_pairs: RankFn
    needs_bank: bool = False
    climbed: Climbed | None = None
