"""The next query with its provenance, and the common test set: pure functions of study, answers and stream names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from study_core import lbfgs, trajectory
from study_core.acquisition import acquisition_named
from study_core.acquisition.pairs import RankedPairs, RankedTrajectories, RankedWeights, Situation
from study_core.comparison import ComparisonSet, Query
from study_core.distinctness import visible_difference, visible_paths
from study_core.domain import Domain
from study_core.knowledge import NOTHING
from study_core.posterior import metropolis
from study_core.posterior.run import Posterior, infer
from study_core.streams import stream
from study_core.study import Study

Participant = int | str
"""Names a session's random streams: the participant's ordinal, or the label of a rehearsal."""

# Controls closer than this, in units of their bounds, are one trajectory, whatever a study's own bound is.
SAME_CONTROLS = 1e-6

MOST_PAIRS_TRIED = 10
"""How many pairs of a ranking are tried, at most, until two trajectories look different."""

TEST_SET = "test-set"
LAST_RESORT = "prior"


@dataclass(frozen=True)
class Provenance:
    """Enough to derive a query again, bit for bit, given the log before it, and to say why it was asked.

    Attributes:
        study_hash: Of the study file.
        seed: The study's.
        stream: Names of the random streams, after the purpose.
        method: Acquisition method; `test-set`, `practice` or `check`; or `prior` where no pair that the method tried
            looked different, and random weights from the prior took their place.
        versions: Ids of domain, sampler, optimiser and, for an active query, acquisition method.
        bank_digest: SHA-256 of the bank of local optima, if the study uses one.
        weights_a: The w that trajectory A is best for, locally at least, a learned feature's weight last; None if the
            method optimises something else.
        weights_b: The same of trajectory B.
        score: Acquisition value of the pair.
        runner_up_score: Acquisition value of the next best pair, if there is one.
        pairs_tried: How many pairs looked alike before this one, plus one.
        has_converged: Whether the optimiser met its tolerance, for A and for B.
        are_distinct: Whether A and B differ, by the study's bound; if not, no pair tried did, and these differ most.
        visible_difference: How far apart A and B look, in body lengths; None in sessions kept before it was recorded.
    """

    study_hash: str
    seed: int
    stream: tuple[str | int, ...]
    method: str
    versions: tuple[str, ...]
    bank_digest: str | None
    weights_a: Float[np.ndarray, " n_features"] | None
    weights_b: Float[np.ndarray, " n_features"] | None
    score: float
    runner_up_score: float | None
    pairs_tried: int
    has_converged: tuple[bool, bool]
    are_distinct: bool
    visible_difference: float | None


@dataclass(frozen=True)
class Imported:
    """Where a query that another program asked was read from; it can't be derived again.

    Attributes:
        method: `imported`, whatever the other program called its own.
        file: Name of the file.
        sha256: Of the file, in hex.
        entry: Place of the query among the file's, from 0.
    """

    method: ClassVar[str] = "imported"

    file: str
    sha256: str
    entry: int


@dataclass(frozen=True)
class ProposedQuery:
    """A query and where it comes from."""

    query: Query
    provenance: Provenance | Imported


@dataclass(frozen=True)
class Ranking:
    """Pairs to try in turn.

    Attributes:
        method: What to call where they come from.
        pairs: Best first.
    """

    method: str
    pairs: RankedPairs


@dataclass(frozen=True)
class _Attempt:
    """A pair turned into trajectories, A first, and whether it can be shown."""

    ranking: Ranking
    rank: int
    controls: Float[np.ndarray, "2 n_controls"]
    weights: Float[np.ndarray, "2 n_features"] | None
    has_converged: tuple[bool, bool]
    difference: float
    is_distinct: bool


def infer_posterior(
    study: Study, participant: Participant, query_index: int, comparisons: ComparisonSet
) -> Posterior:
    """Returns the posterior of one participant from which a query is chosen.

    Args:
        study: The study.
        participant: Names the session's random streams.
        query_index: Index of the query, from 0. After an answer that says nothing it alone changes, and with it the
            samples, so that a method that compares samples doesn't ask the same again.
        comparisons: The active answers so far that say something, in the features of `study.rewards`.
    """
    rng = stream(study.seed, "posterior", participant, query_index)
    return infer(rng, study.rewards.prior, study.response, comparisons, study.sampler)


def propose_active_query(
    study: Study, participant: Participant, query_index: int, posterior: Posterior
) -> ProposedQuery:
    """Returns the query that the study's acquisition method asks next.

    Args:
        study: The study.
        participant: Names the session's random streams.
        query_index: Index of the query in the session, from 0.
        posterior: After the answers so far.
    """
    ranked = rank_active(study, participant, query_index, posterior)
    last_resort = rank_last_resort(study, participant, query_index)
    method = acquisition_named(study.file.acquisition.method)
    return _first_distinct(study, (participant, query_index), (method.version,), (ranked, last_resort))


def rank_active(study: Study, participant: Participant, query_index: int, posterior: Posterior) -> Ranking:
    """Returns the pairs that the study's acquisition method would ask about, best first."""
    section, rewards = study.file.acquisition, study.rewards
    situation = Situation(rewards.domain, posterior, rewards.bank, section.mu, section.min_difference)
    rng = stream(study.seed, "acquisition", participant, query_index)
    method = acquisition_named(section.method)
    return Ranking(section.method, method.rank_pairs(rng, situation, MOST_PAIRS_TRIED + 1))


def rank_last_resort(study: Study, participant: Participant, query_index: int) -> Ranking:
    """Returns what is tried where no pair of the acquisition method looks different."""
    rng = stream(study.seed, "last-resort", participant, query_index)
    return Ranking(LAST_RESORT, _random_weights(study, rng))


def propose_test_set(study: Study) -> tuple[ProposedQuery, ...]:
    """Returns the common test queries: best drives for random pairs of w from the prior, the same for everyone."""
    return tuple(_propose_common(study, TEST_SET, number) for number in range(study.protocol.test_queries))


def propose_common_query(study: Study, purpose: str, number: int) -> ProposedQuery:
    """Returns a query that is the same for everyone and isn't of the test set: for practice, or for a check.

    Args:
        study: The study; what a session knows besides has no part in it.
        purpose: Names the random streams.
        number: Of the query among those of its purpose, from 0.
    """
    return _propose_common(study.knowing(NOTHING), purpose, number)


def _propose_common(study: Study, purpose: str, number: int) -> ProposedQuery:
    return _first_distinct(study, (purpose, number), (), (rank_common(study, purpose, number),))


def rank_common(study: Study, purpose: str, number: int) -> Ranking:
    """Returns the pairs of which a query that is the same for everyone is the first that looks different.

    Args:
        study: The study.
        purpose: `test-set`, `practice` or `check`.
        number: Of the query among those of its purpose, from 0.
    """
    weights_stream = "test-weights" if purpose == TEST_SET else f"{purpose}-weights"
    return Ranking(purpose, _random_weights(study, stream(study.seed, weights_stream, number)))


def _random_weights(study: Study, rng: np.random.Generator) -> RankedWeights:
    """Returns random pairs of w from the prior, none better than another."""
    weights = study.rewards.prior.draw(rng, 2 * MOST_PAIRS_TRIED)
    return RankedWeights(weights.reshape(MOST_PAIRS_TRIED, 2, -1), np.zeros(MOST_PAIRS_TRIED))


def _first_distinct(
    study: Study,
    names: tuple[str | int, ...],
    method_versions: tuple[str, ...],
    rankings: tuple[Ranking, ...],
) -> ProposedQuery:
    """Returns the first pair whose trajectories look different, or of all tried the most different if none do."""
    is_swapped = is_pair_swapped(study, names)
    rng = stream(study.seed, "trajectory", *names)
    attempts: list[_Attempt] = []
    for ranking, rank in tries(rankings):
        attempts.append(_attempt(study, rng, ranking, rank, is_swapped))
        if attempts[-1].is_distinct:
            break
    shown = attempts[-1] if attempts[-1].is_distinct else max(attempts, key=lambda one: one.difference)
    scores = shown.ranking.pairs.scores
    provenance = Provenance(
        study_hash=study.hash,
        seed=study.seed,
        stream=names,
        method=shown.ranking.method,
        versions=(study.domain.id, metropolis.VERSION, lbfgs.VERSION, *method_versions),
        bank_digest=None if study.bank is None else study.bank.digest,
        weights_a=None if shown.weights is None else shown.weights[0],
        weights_b=None if shown.weights is None else shown.weights[1],
        score=float(scores[shown.rank]),
        runner_up_score=float(scores[shown.rank + 1]) if shown.rank + 1 < len(scores) else None,
        pairs_tried=len(attempts),
        has_converged=shown.has_converged,
        are_distinct=shown.is_distinct,
        visible_difference=shown.difference,
    )
    return ProposedQuery(_query(study.domain, shown.controls), provenance)


def is_pair_swapped(study: Study, names: tuple[str | int, ...]) -> bool:
    """Returns whether the second of a ranked pair is called A: drawn, so that the samples' order favours nobody."""
    return bool(stream(study.seed, "order", *names).integers(2))


def tries(rankings: tuple[Ranking, ...]) -> Iterator[tuple[Ranking, int]]:
    """Gives the ranks to try of each ranking, best first."""
    for ranking in rankings:
        for rank in range(min(MOST_PAIRS_TRIED, len(ranking.pairs))):
            yield ranking, rank


def _attempt(
    study: Study, rng: np.random.Generator, ranking: Ranking, rank: int, is_swapped: bool
) -> _Attempt:
    """Returns the trajectories of a pair, searched for if the method ranked weights."""
    pairs, order = ranking.pairs, [1, 0] if is_swapped else [0, 1]
    weights = None if pairs.weights is None else pairs.weights[rank][order]
    if isinstance(pairs, RankedTrajectories):
        controls = pairs.controls[rank][order]
        has_converged = (bool(pairs.has_converged[rank]),) * 2
    else:
        best = best_trajectories(study, rng, pairs.weights[rank][order])
        controls = best.controls
        has_converged = (bool(best.has_converged[0]), bool(best.has_converged[1]))
    paths = visible_paths(study.domain, controls)
    difference = float(visible_difference(paths[:1], paths[1:])[0])
    is_distinct = differ(study.domain, controls) and difference >= study.file.acquisition.min_difference
    return _Attempt(ranking, rank, controls, weights, has_converged, difference, is_distinct)


def best_trajectories(
    study: Study, rng: np.random.Generator, weights: Float[np.ndarray, "n_weights n_features"]
) -> trajectory.BestTrajectories:
    """Returns the best trajectory for each weight vector, as the study searches for them.

    Args:
        study: The study, with what is known.
        rng: Draws the starts, where it searches from random ones.
        weights: Of the features of `study.rewards`.
    """
    section, rewards = study.file.trajectory, study.rewards
    if section.starts is None:
        assert rewards.bank is not None, "a study that searches from a bank has one"
        return trajectory.best_from_bank(rewards.domain, rewards.bank, weights)
    return trajectory.best_trajectories(rng, rewards.domain, weights, section.starts)


def differ(domain: Domain, controls: Float[np.ndarray, "2 n_controls"]) -> bool:
    """Returns whether two trajectories are more than one."""
    difference = np.abs(controls[0] - controls[1]) / (domain.control_upper - domain.control_lower)
    return bool(difference.max() > SAME_CONTROLS)


def _query(domain: Domain, controls: Float[np.ndarray, "2 n_controls"]) -> Query:
    features = domain.features(domain.rollout(controls))
    return Query(controls[0], controls[1], features[0], features[1])
