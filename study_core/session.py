"""The protocol of a session: an append-only log of events, reduced by a pure function to where the person is.

Two counters that must not be mixed: the log *position* orders events; the *query index* names queries, seeds and
results.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from study_core.comparison import Choice, ComparisonSet, Query
from study_core.errors import AnswerNotCurrentError, SessionError
from study_core.knowledge import NOTHING, Knowledge
from study_core.online.feature import Compared, LearnedFeature
from study_core.online.schedule import FEWEST_ANSWERS, n_learned_from
from study_core.posterior.population import PopulationPrior
from study_core.queries import Participant, ProposedQuery
from study_core.study import Study


class Phase(StrEnum):
    """What a query is for."""

    ACTIVE = "active"
    TEST = "test"


@dataclass(frozen=True)
class SessionBegun:
    """The person has read the welcome page and pressed Begin.

    Attributes:
        participant: Names the session's random streams: the participant's ordinal, or a rehearsal's label; never a
            secret.
    """

    participant: Participant


@dataclass(frozen=True)
class QueryPrepared:
    """A query is ready to be shown.

    Attributes:
        query_index: From 0.
        phase: Whether its answer informs the posterior.
        proposed: The query and its provenance.
        clips: SHA-256 of the clip in each picture layout: what exactly is shown.
        code_version: Version of prefstudy that computed or imported it.
        compute_ms: What it cost, one core; None for an imported query.
    """

    query_index: int
    phase: Phase
    proposed: ProposedQuery
    clips: dict[str, str]
    code_version: str
    compute_ms: float | None


@dataclass(frozen=True)
class AnswerGiven:
    """The person chose.

    Attributes:
        query_index: The query that was answered.
        choice: One that the study offers.
        response_time_ms: As measured in the browser; None for an imported answer whose time nobody wrote down.
    """

    query_index: int
    choice: Choice
    response_time_ms: int | None


@dataclass(frozen=True)
class PopulationAdopted:
    """The session goes on from what the people before taught; so its log alone derives its queries again.

    Attributes:
        query_index: The first query that is chosen with it.
        key: Name of the shared model.
        learned_from: Ids of the sessions that taught it.
        population: What they taught; None once one of them has been deleted.
    """

    query_index: int
    key: str
    learned_from: tuple[str, ...]
    population: PopulationPrior | None


@dataclass(frozen=True)
class FeatureLearned:
    """The session's own answers have taught a feature, with which it goes on.

    Attributes:
        query_index: The first query that is chosen with it.
        n_queries: It was learned from the answers to so many first queries.
        feature: The feature; None if the training diverged, and the session goes on with what it had.
        code_version: Version of prefstudy that learned it.
    """

    query_index: int
    n_queries: int
    feature: LearnedFeature | None
    code_version: str


Event = SessionBegun | PopulationAdopted | FeatureLearned | QueryPrepared | AnswerGiven


class Action(StrEnum):
    """What has to happen next."""

    WELCOME = "welcome"
    PREPARE = "prepare"
    ASK = "ask"
    FINISHED = "finished"


@dataclass(frozen=True)
class SessionState:
    """Where a session is: what its log says so far.

    Attributes:
        n_events: Length of the log.
        participant: Names the session's random streams; None on the welcome page.
        prepared: Queries so far, by query index.
        answers: Answers so far, by query index.
        comparisons: The answers that inform the posterior, in the hand-coded features.
        knowledge: What else does.
        n_queries_learned: The last feature was learned from the answers to so many first queries; 0 before that.
    """

    n_events: int
    participant: Participant | None
    prepared: tuple[QueryPrepared, ...]
    answers: tuple[AnswerGiven, ...]
    comparisons: ComparisonSet
    knowledge: Knowledge = NOTHING
    n_queries_learned: int = 0

    @property
    def query_index(self) -> int:
        """Returns the index of the query to ask next, or being asked."""
        return len(self.answers)

    @property
    def current(self) -> QueryPrepared | None:
        """Returns the query being asked, if there is one."""
        return self.prepared[-1] if len(self.prepared) > len(self.answers) else None


def phase_of(study: Study, query_index: int) -> Phase:
    """Returns the phase that a query index belongs to: active queries come first."""
    return Phase.ACTIVE if query_index < study.protocol.active_queries else Phase.TEST


def next_action(study: Study, state: SessionState) -> Action:
    """Returns what has to happen next."""
    if state.participant is None:
        return Action.WELCOME
    if state.current is not None:
        return Action.ASK
    return Action.PREPARE if state.query_index < study.protocol.n_queries else Action.FINISHED


def initial_state(study: Study) -> SessionState:
    """Returns the state of an empty log."""
    return SessionState(0, None, (), (), ComparisonSet.empty(len(study.domain.feature_names)))


def reduce(study: Study, events: Iterable[Event]) -> SessionState:
    """Returns the state that a log leads to.

    Raises:
        SessionError: The log holds an event that was not possible when it came.
    """
    state = initial_state(study)
    for event in events:
        state = apply(study, state, event)
    return state


def apply(study: Study, state: SessionState, event: Event) -> SessionState:
    """Returns the state after one more event.

    Raises:
        SessionError: The event is not possible in this state.
        AnswerNotCurrentError: An answer to another query than the one being asked.
    """
    state = replace(state, n_events=state.n_events + 1)
    if isinstance(event, SessionBegun):
        return _begin(state, event)
    if isinstance(event, (PopulationAdopted, FeatureLearned)):
        return _learn(study, state, event)
    if isinstance(event, QueryPrepared):
        return _prepare(study, state, event)
    return _answer(study, state, event)


def _begin(state: SessionState, event: SessionBegun) -> SessionState:
    if state.participant is not None:
        raise SessionError("Expected a session that has not begun; this one has. Go on with it.")
    return replace(state, participant=event.participant)


def _learn(study: Study, state: SessionState, event: PopulationAdopted | FeatureLearned) -> SessionState:
    if next_action(study, state) is not Action.PREPARE or event.query_index != state.query_index:
        raise SessionError(
            f"Expected something learned before query {state.query_index} is prepared, got it for query "
            f"{event.query_index}."
        )
    if isinstance(event, PopulationAdopted):
        return replace(state, knowledge=replace(state.knowledge, population=event.population))
    feature = event.feature or state.knowledge.feature
    knowledge = replace(state.knowledge, feature=feature)
    return replace(state, knowledge=knowledge, n_queries_learned=event.n_queries)


def _prepare(study: Study, state: SessionState, event: QueryPrepared) -> SessionState:
    if next_action(study, state) is not Action.PREPARE or event.query_index != state.query_index:
        raise SessionError(
            f"Expected query {state.query_index} of {study.protocol.n_queries} after its predecessor's answer; "
            f"got query {event.query_index}."
        )
    phase = phase_of(study, event.query_index)
    if event.phase is not phase:
        raise SessionError(
            f"Expected query {event.query_index} in the {phase} phase, got {event.phase}. Prepare it for that phase."
        )
    return replace(state, prepared=(*state.prepared, event))


def _answer(study: Study, state: SessionState, event: AnswerGiven) -> SessionState:
    current = state.current
    if current is None or current.query_index != event.query_index:
        asked = "none" if current is None else f"query {current.query_index}"
        raise AnswerNotCurrentError(
            f"Expected an answer to the current query ({asked}); got query {event.query_index}."
        )
    if event.choice not in study.answers:
        offered = " or ".join(f"'{choice}'" for choice in study.answers)
        raise SessionError(f"Expected {offered}, which the study offers; got '{event.choice}'.")
    comparisons = state.comparisons
    if current.phase is Phase.ACTIVE:
        comparisons = comparisons.append(current.proposed.query, event.choice)
    return replace(state, answers=(*state.answers, event), comparisons=comparisons)


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


def feature_due(study: Study, state: SessionState, query_index: int) -> int:
    """Returns from the answers to how many first queries a feature is to be learned before a query; 0 if none is."""
    every = study.file.learning.feature_every
    if every is None:
        return 0
    n_queries = n_learned_from(every, study.protocol.active_queries, query_index)
    n_preferring = sum(given.choice.sign != 0.0 for given in state.answers[:n_queries])
    is_due = n_queries > state.n_queries_learned and n_preferring >= FEWEST_ANSWERS
    return n_queries if is_due else 0


def query_of(state: SessionState, query_index: int) -> Query:
    """Returns a query that has been prepared."""
    return state.prepared[query_index].proposed.query
