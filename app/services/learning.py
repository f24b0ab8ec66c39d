"""Online feature learning: begun some queries before the first query that is chosen with what is learned."""

from __future__ import annotations

from app.services.computations import has_succeeded
from app.services.continuation import Computation, FeatureRequest
from app.services.runtime import LiveSession, Runtime
from study_core.learning import compared, feature_due
from study_core.online.schedule import LEAD
from study_core.session import SessionState, session_plan
from study_core.study import Study

# Before the models of people who have finished, which nobody is going to wait for.
_URGENCY = 0.0


def begin_early(runtime: Runtime, live: LiveSession) -> None:
    """Starts learning what will be due, as soon as the answers are there."""
    plan = session_plan(live.study, live.state)
    upcoming = plan.index_of_active(plan.n_active_before(live.state.query_index) + LEAD)
    due = feature_due(live.study, live.state, upcoming)
    if due is not None and due.n_queries <= len(live.state.answers):
        feature_before(runtime, live, live.state, upcoming)


def feature_before(
    runtime: Runtime, live: LiveSession, state: SessionState, query_index: int
) -> Computation | None:
    """Returns the feature that is due before a query, as `FeatureLearned`, begun now if it wasn't; None if none is.

    Args:
        runtime: The services' resources.
        live: The session; the caller holds its lock.
        state: A state of it that has all the answers that the feature is learned from.
        query_index: The query.
    """
    request = feature_request(live.study, state, query_index)
    if request is None:
        return None
    if live.learning is None or not _is_under_way(live.learning, request):
        computation = runtime.engine.submit(
            request.key, runtime.learn_fn, request, _URGENCY, resource="training"
        )
        live.learning = (request, computation)
    return live.learning[1]


def feature_request(study: Study, state: SessionState, query_index: int) -> FeatureRequest | None:
    """Returns what the feature that is due before a query is learned from; None if none is due."""
    due = feature_due(study, state, query_index)
    if due is None:
        return None
    assert state.participant is not None, "a session with answers has begun"
    judged = compared(state, due.n_queries)
    return FeatureRequest(study.text, state.participant, due.query_index, due.n_queries, judged)


def _is_under_way(learning: tuple[FeatureRequest, Computation], request: FeatureRequest) -> bool:
    """Returns whether a feature is learned, or being learned, from the same answers; a failed one is learned again."""
    learned_from, computation = learning
    is_same = learned_from.key == request.key
    return is_same and (not computation.done() or has_succeeded(computation))
