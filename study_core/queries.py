"""The next query with its provenance, and the common test set: pure functions of study, answers and stream names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core import lbfgs, trajectory
from study_core.acquisition import acquisition_named
from study_core.acquisition.pairs import RankedPairs
from study_core.comparison import ComparisonSet, Query
from study_core.domain import Domain
from study_core.posterior import metropolis
from study_core.posterior.run import Posterior, infer
from study_core.streams import stream
from study_core.study import Study

Participant = int | str
"""Names a session's random streams: the participant's ordinal, or the label of a rehearsal."""

# Controls closer than this, in units of their bounds, are one trajectory: nobody could tell the two apart.
SAME_CONTROLS = 1e-6

# How many of the best pairs are turned into trajectories, at most, until two differ.
_MOST_PAIRS_TRIED = 10


@dataclass(frozen=True)
class Provenance:
    """Enough to derive a query again, bit for bit, and to say why it was asked.

    Attributes:
        study_hash: Of the study file.
        seed: The study's.
        stream: Names of the random streams, after the purpose.
        method: Acquisition method, or `test-set`.
        versions: Ids of domain, sampler and optimiser.
        weights_a: The w that trajectory A is best for.
        weights_b: The w that trajectory B is best for.
        score: Acquisition value of the pair.
        runner_up_score: Acquisition value of the next best pair, if there is one.
        pairs_tried: How many pairs had equal controls before this one, plus one.
        has_converged: Whether the optimiser met its tolerance, for A and for B.
        are_distinct: Whether A and B differ; if not, every pair tried had equal controls.
    """

    study_hash: str
    seed: int
    stream: tuple[str | int, ...]
    method: str
    versions: tuple[str, ...]
    weights_a: Float[np.ndarray, " n_features"]
    weights_b: Float[np.ndarray, " n_features"]
    score: float
    runner_up_score: float | None
    pairs_tried: int
    has_converged: tuple[bool, bool]
    are_distinct: bool


@dataclass(frozen=True)
class ProposedQuery:
    """A query and where it comes from."""

    query: Query
    provenance: Provenance


def infer_posterior(study: Study, participant: Participant, comparisons: ComparisonSet) -> Posterior:
    """Returns the posterior of one participant after their active answers so far."""
    rng = stream(study.seed, "posterior", participant, len(comparisons))
    return infer(rng, study.prior, study.response, comparisons, study.sampler)


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
    names = (participant, query_index)
    section = study.file.acquisition
    ranked = acquisition_named(section.method)(
        stream(study.seed, "acquisition", *names), posterior, section.mu, _MOST_PAIRS_TRIED + 1
    )
    return _first_distinct(study, names, section.method, posterior.samples, ranked)


def propose_test_set(study: Study) -> tuple[ProposedQuery, ...]:
    """Returns the common test queries: best drives for random pairs of w from the prior, the same for everyone."""
    return tuple(_propose_test_query(study, index) for index in range(study.protocol.test_queries))


def _propose_test_query(study: Study, index: int) -> ProposedQuery:
    names = ("test-set", index)
    weights = study.prior.draw(stream(study.seed, "test-weights", index), 2 * _MOST_PAIRS_TRIED)
    pairs = np.arange(len(weights)).reshape(-1, 2)
    return _first_distinct(study, names, "test-set", weights, RankedPairs(pairs, np.zeros(len(pairs))))


def _first_distinct(
    study: Study,
    names: tuple[str | int, ...],
    method: str,
    weights: Float[np.ndarray, "n_weights n_features"],
    ranked: RankedPairs,
) -> ProposedQuery:
    """Returns the best pair whose trajectories differ, or the last one tried if none do."""
    rng = stream(study.seed, "trajectory", *names)
    # Which of the two is called A is drawn, so that the order of the samples favours nobody.
    is_swapped = bool(stream(study.seed, "order", *names).integers(2))
    tries = range(min(_MOST_PAIRS_TRIED, len(ranked.indices)))
    for rank in tries:
        pair = ranked.indices[rank][::-1] if is_swapped else ranked.indices[rank]
        best = trajectory.best_trajectories(rng, study.domain, weights[pair], study.file.trajectory.starts)
        are_distinct = _differ(study.domain, best.controls)
        if are_distinct or rank == tries[-1]:
            break
    runner_up = float(ranked.scores[rank + 1]) if rank + 1 < len(ranked.scores) else None
    converged_a, converged_b = (bool(flag) for flag in best.has_converged)
    provenance = Provenance(
        study_hash=study.hash,
        seed=study.seed,
        stream=names,
        method=method,
        versions=(study.domain.id, metropolis.VERSION, lbfgs.VERSION),
        weights_a=weights[pair[0]],
        weights_b=weights[pair[1]],
        score=float(ranked.scores[rank]),
        runner_up_score=runner_up,
        pairs_tried=rank + 1,
        has_converged=(converged_a, converged_b),
        are_distinct=are_distinct,
    )
    return ProposedQuery(_query(study.domain, best.controls), provenance)


def _differ(domain: Domain, controls: Float[np.ndarray, "2 n_controls"]) -> bool:
    difference = np.abs(controls[0] - controls[1]) / (domain.control_upper - domain.control_lower)
    return bool(difference.max() > SAME_CONTROLS)


def _query(domain: Domain, controls: Float[np.ndarray, "2 n_controls"]) -> Query:
    features = domain.features(domain.rollout(controls))
    return Query(controls[0], controls[1], features[0], features[1])
