"""The protocol of a session: an append-only log of events, reduced by a pure function to where the person is.

Two counters that must not be mixed: the log *position* orders events; the *query index* names queries, seeds and
results.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

from study_core.comparison import ComparisonSet, Query
from study_core.errors import AnswerNotCurrentError, SessionError
from study_core.events import (
    AnswerGiven,
    AnswerTakenBack,
    BreakTaken,
    Event,
    FeatureLearned,
    LanguageChosen,
    PopulationAdopted,
    QueryPrepared,
    SessionBegun,
    SessionEnded,
    SessionReopened,
    StepOutcome,
    StepTaken,
)
from study_core.knowledge import NOTHING, Knowledge
from study_core.path import ConsentStep, Ending, PracticeStep, QueriesStep, QuestionnaireStep, Step
from study_core.plan import Phase, Plan, plan_of
from study_core.queries import Participant
from study_core.study import Study

_ENDING_OF = {
    StepOutcome.DECLINED: Ending.DECLINED,
    StepOutcome.FAILED: Ending.FAILED,
    StepOutcome.SCREENED_OUT: Ending.SCREENED_OUT,
}


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
        is_reopened: Whether it had ended before.
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
    is_reopened: bool = False
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
    if isinstance(event, SessionReopened):
        return _reopen(state)
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


def can_be_reopened(state: SessionState) -> bool:
    """Returns whether a session has ended before the end of its path; whoever declined has given no consent to it."""
    return state.ending not in (None, Ending.COMPLETED, Ending.DECLINED, Ending.DELETED)


def _reopen(state: SessionState) -> SessionState:
    if not can_be_reopened(state):
        raise SessionError(
            f"Expected a session that has ended before its path does, got one that is {state.ending or 'going on'}."
        )
    return replace(state, ending=None, is_reopened=True, n_tries=0)


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


def query_of(state: SessionState, query_index: int) -> Query:
    """Returns a query that has been prepared."""
    return state.prepared[query_index].proposed.query
