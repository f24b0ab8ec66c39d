"""What a session's answers teach: the posterior, features that are learned on the way, and what the evaluation sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study_core.comparison import ComparisonSet
from study_core.online.feature import Compared
from study_core.online.schedule import FEWEST_ANSWERS, LEAD, n_learned_from
from study_core.plan import Phase
from study_core.session import SessionState, session_plan
from study_core.study import Study


@dataclass(frozen=True)
class FeatureDue:
    """A feature that is to be learned.

    Attributes:
        n_queries: From the answers to so many first queries.
        query_index: The first query that is chosen with it.
    """

    n_queries: int
    query_index: int


def compared(state: SessionState, n_queries: int) -> Compared:
    """Returns what the answers to the first active queries compared, as far as they say something."""
    asked = zip(state.prepared[:n_queries], state.answers[:n_queries], strict=False)
    queries = [
        prepared.proposed.query
        for prepared, given in asked
        if prepared.phase is Phase.ACTIVE and given.choice.is_informative
    ]
    known = state.comparisons
    comparisons = ComparisonSet(known.feature_diffs[: len(queries)], known.signs[: len(queries)])
    controls = [np.stack([query.controls_a, query.controls_b]) for query in queries]
    return Compared(comparisons, np.array(controls))


def known_comparisons(study: Study, state: SessionState) -> ComparisonSet:
    """Returns the answers that inform the posterior, in the features that the session goes on with."""
    has_feature = state.knowledge.feature is not None
    asked = compared(state, len(state.answers)) if has_feature else None
    return state.knowledge.add_to(study.domain, state.comparisons, asked)


def test_comparisons(study: Study, state: SessionState) -> ComparisonSet:
    """Returns the answers to the common test queries that prefer one, in the features that the session ended with."""
    answered = [
        (prepared.proposed.query, given.choice)
        for prepared, given in zip(state.prepared, state.answers, strict=False)
        if prepared.phase is Phase.TEST and given.choice.sign != 0.0
    ]
    comparisons = ComparisonSet.empty(len(study.domain.feature_names))
    for query, choice in answered:
        comparisons = comparisons.append(query, choice)
    feature, domain = state.knowledge.feature, study.domain
    if feature is None or not answered:
        return comparisons
    sides = [[query.controls_a for query, _ in answered], [query.controls_b for query, _ in answered]]
    of_a, of_b = (feature.of_trajectories(domain, domain.rollout(np.array(side))) for side in sides)
    return ComparisonSet(np.column_stack([comparisons.feature_diffs, of_a - of_b]), comparisons.signs)


def feature_due(study: Study, state: SessionState, query_index: int) -> FeatureDue | None:
    """Returns the feature that is to be learned before a query is chosen, if one is."""
    every = study.file.learning.feature_every
    plan = session_plan(study, state)
    if every is None or not plan.needs_posterior(query_index):
        return None
    n_active = study.protocol.active_queries
    n_learned = n_learned_from(every, n_active, plan.n_active_before(query_index))
    if not n_learned:
        return None
    due = FeatureDue(plan.index_of_active(n_learned), plan.index_of_active(n_learned + LEAD))
    n_preferring = sum(
        given.choice.sign != 0.0
        for slot, given in zip(plan.slots[: due.n_queries], state.answers, strict=False)
        if slot.phase is Phase.ACTIVE
    )
    is_due = due.n_queries > state.n_queries_learned and n_preferring >= FEWEST_ANSWERS
    return due if is_due else None
