"""The protocol of a session: an append-only log of events, reduced by a pure function to where the person is.

Two counters that must not be mixed: the log *position* orders events; the *query index* names queries, seeds and
results.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from study_core.comparison import Choice, ComparisonSet, Query
from study_core.errors import AnswerNotCurrentError, SessionError
from study_core.knowledge import NOTHING, Knowledge
from study_core.online.feature import Compared, LearnedFeature
from study_core.online.schedule import FEWEST_ANSWERS, LEAD, n_learned_from
from study_core.path import ConsentStep, Ending, PracticeStep, QueriesStep, QuestionnaireStep, Step
from study_core.plan import Phase, Plan, Position, plan_of
from study_core.posterior.population import PopulationPrior
from study_core.queries import Participant, ProposedQuery
from study_core.study import Study

MOST_CONFIDENT = 5
"""Confidence goes from 1, a guess, to this."""


class StepOutcome(StrEnum):
    """What became of a step of the path."""

    DONE = "done"
    AGAIN = "again"
    DECLINED = "declined"
    FAILED = "failed"
    SCREENED_OUT = "screened-out"


_ENDING_OF = {
    StepOutcome.DECLINED: Ending.DECLINED,
    StepOutcome.FAILED: Ending.FAILED,
    StepOutcome.SCREENED_OUT: Ending.SCREENED_OUT,
}


@dataclass(frozen=True)
class SessionBegun:
    """The person has read the welcome page and pressed Begin.

    Attributes:
        participant: Names the session's random streams: the participant's ordinal, or a rehearsal's label; never a
            secret.
    """

    participant: Participant


@dataclass(frozen=True)
class LanguageChosen:
    """From here on the person reads the study in that language."""

    language: str


@dataclass(frozen=True)
class StepTaken:
    """The person has been through a step of the path that isn't queries, or has tried to.

    Attributes:
        step: Its place in the path, from 0.
        outcome: `again` leaves the person where they are, for another try.
        content: What they answered, and what exactly they had read.
    """

    step: int
    outcome: StepOutcome
    content: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BreakTaken:
    """The person goes on after a break.

    Attributes:
        query_index: The query before which the break was.
    """

    query_index: int


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
        first_shown: The trajectory in the first position on the screen; None where nobody wrote it down: in an
            imported session, and in one kept before sides were drawn, which showed A first.
        repeat_of: Index of the query that this one asks again.
        instructed: What a check tells the person to choose.
    """

    query_index: int
    phase: Phase
    proposed: ProposedQuery
    clips: dict[str, str]
    code_version: str
    compute_ms: float | None
    first_shown: Choice | None
    repeat_of: int | None = None
    instructed: Position | None = None

    @property
    def side_shown_first(self) -> Choice:
        """Returns the trajectory that stands in the first position: A where nobody wrote it down."""
        return self.first_shown or Choice.A


@dataclass(frozen=True)
class AnswerGiven:
    """The person chose.

    Attributes:
        query_index: The query that was answered.
        choice: One that the study offers.
        response_time_ms: As measured in the browser; None for an imported answer whose time nobody wrote down.
        confidence: How sure the person is, from 1 to 5, where the study asks it.
    """

    query_index: int
    choice: Choice
    response_time_ms: int | None
    confidence: int | None = None


@dataclass(frozen=True)
class AnswerTakenBack:
    """The person answers the last query again.

    Attributes:
        query_index: That query.
    """

    query_index: int


@dataclass(frozen=True)
class SessionEnded:
    """The session is over before its path is: the person has stopped, or was away for too long.

    Attributes:
        ending: `stopped` or `timed-out`.
    """

    ending: Ending


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


Event = (
    SessionBegun
    | LanguageChosen
    | StepTaken
    | BreakTaken
    | PopulationAdopted
    | FeatureLearned
    | QueryPrepared
    | AnswerGiven
    | AnswerTakenBack
    | SessionEnded
)


@dataclass(frozen=True)
class FeatureDue:
    """A feature that is to be learned.

    Attributes:
        n_queries: From the answers to so many first queries.
        query_index: The first query that is chosen with it.
    """

    n_queries: int
    query_index: int


class Action(StrEnum):
    """What has to happen next."""

    WELCOME = "welcome"
    STEP = "step"
    PREPARE = "prepare"
    BREAK = "break"
    ASK = "ask"
    FINISHED = "finished"


@dataclass(frozen=True)
class SessionState:
    """Where a session is: what its log says so far.

    Attributes:
        n_events: Length of the log.
        participant: Names the session's random streams; None on the welcome page.
        prepared: Queries so far, by query index.
        answers: Answers so far, by query index; what was taken back isn't among them.
        comparisons: The answers that inform the posterior, in the hand-coded features.
        knowledge: What else does.
        n_queries_learned: The last feature was learned from the answers to so many first queries; 0 before that.
        language: In which the person reads; None for the study's default.
        step: Place in the path, from 0.
        n_tries: How often the step's check was tried without success.
        taken: What was said in the steps so far.
        last_break: The query before which the last break was; 0 before the first.
        ending: How the session ended; None while it goes on.
        before_answer: The state before the last answer, in studies that let it be taken back.
    """

    n_events: int
    participant: Participant | None
    prepared: tuple[QueryPrepared, ...]
    answers: tuple[AnswerGiven, ...]
    comparisons: ComparisonSet
    knowledge: Knowledge = NOTHING
    n_queries_learned: int = 0
    language: str | None = None
    step: int = 0
    n_tries: int = 0
    taken: tuple[StepTaken, ...] = ()
    last_break: int = 0
    ending: Ending | None = None
    before_answer: SessionState | None = None

    @property
    def query_index(self) -> int:
        """Returns the index of the query to ask next, or being asked."""
        return len(self.answers)

    @property
    def current(self) -> QueryPrepared | None:
        """Returns the query being asked, if there is one; during a break, the one that follows it."""
        is_asked = self.ending is None and len(self.prepared) > len(self.answers)
        return self.prepared[-1] if is_asked else None


def session_plan(study: Study, state: SessionState) -> Plan:
    """Returns the plan of a session that has begun."""
    assert state.participant is not None, "a session that has not begun has no plan"
    return plan_of(study, state.participant)


def current_step(study: Study, state: SessionState) -> Step | None:
    """Returns the step of the path that the person is at; None when the session is over or not begun."""
    is_on_the_way = state.participant is not None and state.ending is None
    return study.file.path[state.step] if is_on_the_way else None


def _is_asking(study: Study, state: SessionState) -> bool:
    """Returns whether the step being taken has a query left."""
    step = current_step(study, state)
    if isinstance(step, PracticeStep):
        return state.query_index < study.n_practice
    return isinstance(step, QueriesStep) and state.query_index < study.n_queries


def _is_break_due(study: Study, state: SessionState) -> bool:
    step = current_step(study, state)
    if not isinstance(step, QueriesStep) or step.break_every is None:
        return False
    n_answered = state.query_index - study.n_practice
    is_due = n_answered > 0 and n_answered % step.break_every == 0
    return is_due and state.query_index > state.last_break


def needs_query(study: Study, state: SessionState) -> bool:
    """Returns whether the session can't go on without a query that isn't prepared yet; so it may be in a break."""
    return _is_asking(study, state) and state.current is None


def next_action(study: Study, state: SessionState) -> Action:
    """Returns what has to happen next."""
    if state.participant is None and state.ending is None:
        return Action.WELCOME
    if state.ending is not None:
        return Action.FINISHED
    if not _is_asking(study, state):
        return Action.STEP
    if _is_break_due(study, state):
        return Action.BREAK
    return Action.PREPARE if state.current is None else Action.ASK


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
    if state.ending is not None:
        kind = AnswerNotCurrentError if isinstance(event, AnswerGiven) else SessionError
        raise kind(f"Expected a session that goes on; this one has ended: {state.ending}.")
    if isinstance(event, SessionBegun):
        return _begin(state, event)
    if isinstance(event, LanguageChosen):
        return _choose_language(study, state, event)
    if isinstance(event, StepTaken):
        return _take_step(study, state, event)
    if isinstance(event, BreakTaken):
        return _take_break(study, state, event)
    if isinstance(event, PopulationAdopted):
        return _adopt(state, event)
    if isinstance(event, FeatureLearned):
        return _learn(study, state, event)
    if isinstance(event, QueryPrepared):
        return _prepare(study, state, event)
    if isinstance(event, AnswerGiven):
        return _answer(study, state, event)
    if isinstance(event, AnswerTakenBack):
        return _take_back(study, state, event)
    return _end(state, event)


def _begin(state: SessionState, event: SessionBegun) -> SessionState:
    if state.participant is not None:
        raise SessionError("Expected a session that has not begun; this one has. Go on with it.")
    return replace(state, participant=event.participant)


def _choose_language(study: Study, state: SessionState, event: LanguageChosen) -> SessionState:
    if event.language not in study.languages:
        raise SessionError(f"Expected {' or '.join(study.languages)}, got the language '{event.language}'.")
    return replace(state, language=event.language)


def _take_step(study: Study, state: SessionState, event: StepTaken) -> SessionState:
    if next_action(study, state) is not Action.STEP or event.step != state.step:
        raise SessionError(
            f"Expected what follows step {state.step} of the path; got step {event.step}. Show the current page."
        )
    if event.outcome not in outcomes_of(study.file.path[state.step], state.n_tries):
        raise SessionError(f"Expected an outcome that step {event.step} can have, got '{event.outcome}'.")
    state = replace(state, taken=(*state.taken, event), before_answer=None)
    if event.outcome is StepOutcome.AGAIN:
        return replace(state, n_tries=state.n_tries + 1)
    if event.outcome in _ENDING_OF:
        return replace(state, ending=_ENDING_OF[event.outcome])
    return _go_on(study, state)


def outcomes_of(step: Step, n_tries: int) -> tuple[StepOutcome, ...]:
    """Returns what can become of a step that was tried so often before."""
    if isinstance(step, ConsentStep):
        return (StepOutcome.DONE, StepOutcome.DECLINED)
    if isinstance(step, PracticeStep):
        is_last_chance = n_tries + 1 >= step.chances
        return (StepOutcome.DONE, StepOutcome.FAILED if is_last_chance else StepOutcome.AGAIN)
    if isinstance(step, QuestionnaireStep):
        return (StepOutcome.DONE, StepOutcome.SCREENED_OUT)
    return (StepOutcome.DONE,)


def _go_on(study: Study, state: SessionState) -> SessionState:
    """Returns the state at the next step, or at the end of the path."""
    state = replace(state, step=state.step + 1, n_tries=0)
    is_over = state.step == len(study.file.path)
    return replace(state, ending=Ending.COMPLETED) if is_over else state


def _take_break(study: Study, state: SessionState, event: BreakTaken) -> SessionState:
    if next_action(study, state) is not Action.BREAK or event.query_index != state.query_index:
        raise SessionError(f"Expected a break before query {event.query_index}; there is none.")
    return replace(state, last_break=event.query_index)


def _end(state: SessionState, event: SessionEnded) -> SessionState:
    if event.ending not in (Ending.STOPPED, Ending.TIMED_OUT):
        raise SessionError(
            f"Expected the ending '{Ending.STOPPED}' or '{Ending.TIMED_OUT}', got '{event.ending}'. "
            "Take the step that leads there."
        )
    return replace(state, ending=event.ending)


def _adopt(state: SessionState, event: PopulationAdopted) -> SessionState:
    is_first = state.participant is not None and not state.prepared
    if not is_first or event.query_index != state.query_index:
        raise SessionError(
            f"Expected what people before taught at the beginning of a session, got it for query {event.query_index}."
        )
    return replace(state, knowledge=replace(state.knowledge, population=event.population))


def _learn(study: Study, state: SessionState, event: FeatureLearned) -> SessionState:
    if not needs_query(study, state) or event.query_index != state.query_index:
        raise SessionError(
            f"Expected a feature learned before query {state.query_index} is prepared, got it for query "
            f"{event.query_index}."
        )
    feature = event.feature or state.knowledge.feature
    knowledge = replace(state.knowledge, feature=feature)
    return replace(state, knowledge=knowledge, n_queries_learned=event.n_queries)


def _prepare(study: Study, state: SessionState, event: QueryPrepared) -> SessionState:
    if not needs_query(study, state) or event.query_index != state.query_index:
        raise SessionError(
            f"Expected query {state.query_index} of {study.n_queries} after its predecessor's answer; "
            f"got query {event.query_index}."
        )
    phase = session_plan(study, state).slots[event.query_index].phase
    if event.phase is not phase:
        raise SessionError(
            f"Expected query {event.query_index} in the {phase} phase, got {event.phase}. Prepare it for that phase."
        )
    return replace(state, prepared=(*state.prepared, event))


def _answer(study: Study, state: SessionState, event: AnswerGiven) -> SessionState:
    current = state.current
    is_asked = next_action(study, state) is Action.ASK
    if current is None or not is_asked or current.query_index != event.query_index:
        asked = "none" if current is None or not is_asked else f"query {current.query_index}"
        raise AnswerNotCurrentError(
            f"Expected an answer to the current query ({asked}); got query {event.query_index}."
        )
    if event.choice not in study.answers:
        offered = " or ".join(f"'{choice}'" for choice in study.answers)
        raise SessionError(f"Expected {offered}, which the study offers; got '{event.choice}'.")
    before = replace(state, before_answer=None) if study.file.answering.take_back else None
    comparisons = state.comparisons
    if current.phase is Phase.ACTIVE:
        comparisons = comparisons.append(current.proposed.query, event.choice)
    state = replace(state, answers=(*state.answers, event), comparisons=comparisons, before_answer=before)
    has_more = _is_asking(study, state) or _has_check(current_step(study, state))
    return state if has_more else _go_on(study, state)


def _has_check(step: Step | None) -> bool:
    return isinstance(step, PracticeStep) and step.check is not None


def can_take_back(study: Study, state: SessionState) -> bool:
    """Returns whether the last answer can be taken back: the study allows it, and its step goes on."""
    before = state.before_answer
    return before is not None and before.step == state.step and _is_asking(study, state)


def _take_back(study: Study, state: SessionState, event: AnswerTakenBack) -> SessionState:
    before = state.before_answer
    if before is None or not can_take_back(study, state) or event.query_index != before.query_index:
        raise SessionError(f"Expected the last answer, and that once; query {event.query_index} isn't it.")
    return replace(before, n_events=state.n_events, language=state.language, last_break=state.last_break)


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


def query_of(state: SessionState, query_index: int) -> Query:
    """Returns a query that has been prepared."""
    return state.prepared[query_index].proposed.query
