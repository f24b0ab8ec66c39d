"""Deriving every query of a person again, to the last bit, from their study and their log alone.

The log is walked event by event; what comes next is computed from the events before it by the functions that the
engine runs. So what was withdrawn because an answer was taken back is derived as well.
"""

from __future__ import annotations

from collections.abc import Callable

from app.services.learning import feature_request
from app.services.preparation import posterior_record, request_of
from app.services.replay.errors import ReplayDifferenceError
from app.services.replay.person import ExportedPerson
from app.services.runtime import OpenStudy, Runtime
from app.store import PosteriorRecord
from study_core.events import AnswerTakenBack, FeatureLearned, QueryPrepared
from study_core.replay import Difference, first_difference
from study_core.session import SessionState, apply, initial_state


def derive(
    runtime: Runtime, person: ExportedPerson, on_query: Callable[[], None] = lambda: None
) -> dict[int, PosteriorRecord]:
    """Derives a person's queries, and the features learned on the way, and compares them with the log.

    Args:
        runtime: What computes.
        person: The person; one without a hindrance.
        on_query: Called after each query.

    Returns:
        The posteriors of the queries that stand, by query index.

    Raises:
        ReplayDifferenceError: Something comes out differently; the message names the first number.
    """
    assert person.state.participant is not None, "who was asked something has begun"
    opened = runtime.open_study(person.study)
    state = initial_state(person.study)
    learned: FeatureLearned | None = None
    posteriors: dict[int, PosteriorRecord] = {}
    for event in person.log:
        if isinstance(event, FeatureLearned):
            learned = event
            _compare_feature(runtime, person, state, event)
        elif isinstance(event, QueryPrepared):
            _require_feature(person, state, event)
            posterior = _compare_query(runtime, person, opened, state, event, learned)
            if posterior is not None:
                posteriors[event.query_index] = posterior
            learned = None
            on_query()
        elif isinstance(event, AnswerTakenBack):
            posteriors = {index: each for index, each in posteriors.items() if index <= event.query_index}
        state = apply(person.study, state, event)
    return posteriors


def _compare_query(
    runtime: Runtime,
    person: ExportedPerson,
    opened: OpenStudy,
    state: SessionState,
    event: QueryPrepared,
    learned: FeatureLearned | None,
) -> PosteriorRecord | None:
    derived = runtime.continue_fn(request_of(opened, state, event.query_index, learned))
    difference = first_difference(event, derived.prepared)
    if difference is not None:
        what = f"query {event.query_index} is not the one that the answers before it lead to"
        raise _different(person, what, difference)
    return None if derived.posterior is None else posterior_record(event.query_index, derived.posterior)


def _compare_feature(
    runtime: Runtime, person: ExportedPerson, state: SessionState, event: FeatureLearned
) -> None:
    request = feature_request(person.study, state, event.query_index)
    if request is None:
        raise ReplayDifferenceError(
            f"{person.source}: expected no feature to be learned before query {event.query_index}; the log has one."
        )
    difference = first_difference(event, runtime.learn_fn(request))
    if difference is not None:
        what = f"the feature learned before query {event.query_index} is not the one that the session went on with"
        raise _different(person, what, difference)


def _require_feature(person: ExportedPerson, state: SessionState, event: QueryPrepared) -> None:
    """Refuses a log in which a feature was due before a query and none was learned."""
    if feature_request(person.study, state, event.query_index) is not None:
        raise ReplayDifferenceError(
            f"{person.source}: expected a feature to be learned before query {event.query_index}; the log has none."
        )


def _different(person: ExportedPerson, what: str, difference: Difference) -> ReplayDifferenceError:
    hint = (
        ""
        if person.machines
        else (
            " Nobody wrote down on what type of processor it was computed; if it was another, verify each step alone "
            "with --steps."
        )
    )
    return ReplayDifferenceError(f"{person.source}: {what}: {difference}.{hint}")
