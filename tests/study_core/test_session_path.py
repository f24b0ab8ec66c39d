"""A session along a whole path against a model of its own: a list of stations, and where the person stands in it."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study_core.comparison import Choice
from study_core.errors import AnswerNotCurrentError, SessionError
from study_core.events import (
    AnswerGiven,
    AnswerTakenBack,
    BreakTaken,
    FeatureLearned,
    LanguageChosen,
    PopulationAdopted,
    SessionBegun,
    SessionEnded,
    StepOutcome,
    StepTaken,
)
from study_core.knowledge import Knowledge
from study_core.path import Ending
from study_core.plan import Phase, plan_of
from study_core.posterior.population import PopulationPrior
from study_core.session import Action, apply, can_take_back, current_step, initial_state, next_action, reduce
from study_core.study import parse_study
from tests.study_core.made_up import learned_feature, prepared
from tests.study_core.references import study_text

N_PRACTICE, N_ACTIVE, N_REPEATS, N_TEST, BREAK_EVERY, CHANCES = 2, 4, 1, 2, 3, 3
PATH = f"""
[[path]]
step = "consent"
[[path]]
step = "practice"
queries = {N_PRACTICE}
check = "comprehension"
chances = {CHANCES}
[[path]]
step = "queries"
break_every = {BREAK_EVERY}
[[path]]
step = "questionnaire"
questionnaire = "age"
[[path]]
step = "debrief"

[[questionnaire.comprehension]]
name = "which"
kind = "number"
label = "What is 1 + 1?"
right = 2

[[questionnaire.age]]
name = "years"
kind = "number"
label = "How old are you?"
"""


def path_study(take_back=True, **changes):
    words = {f"text__{name}": name for name in ("consent", "practice", "break", "debrief")}
    numbers = {"active_queries": N_ACTIVE, "test_queries": N_TEST, "repeats": N_REPEATS}
    protocol = {f"protocol__{name}": number for name, number in numbers.items()}
    answers = {"response__answers": ["a", "b", "skip"], "answering__take_back": take_back}
    return parse_study(study_text(**{**words, **protocol, **answers, **changes}) + PATH)


STUDY, FIRM = path_study(), path_study(take_back=False)
PHASES = [slot.phase for slot in plan_of(STUDY, 1).slots]
N = len(PHASES)
SIGNS = {Choice.A: 1.0, Choice.B: -1.0}
OUTCOMES = {0: {"done", "declined"}, 1: {"done"}, 3: {"done", "screened-out"}, 4: {"done"}}


def stations():
    """Everything that a person passes, in order: what it is, and which."""
    yield "welcome", 0
    yield "step", 0
    yield from (("query", i) for i in range(N_PRACTICE))
    yield "step", 1
    for i in range(N_PRACTICE, N):
        if i > N_PRACTICE and (i - N_PRACTICE) % BREAK_EVERY == 0:
            yield "break", i
        yield "query", i
    yield from (("step", 3), ("step", 4), ("end", 0))


STATIONS = list(stations())


@dataclass
class Model:
    """Where a person should be."""

    at: int = 0
    is_prepared: bool = False
    n_tries: int = 0
    answers: list = field(default_factory=list)
    breaks: set = field(default_factory=set)
    last_answered: int | None = None
    ending: str | None = None

    def accepts(self, event):
        if self.ending is not None:
            return False
        kind, which = STATIONS[self.at]
        match event:
            case SessionBegun():
                return kind == "welcome"
            case LanguageChosen():
                return event.language == "en"
            case SessionEnded():
                return event.ending in ("stopped", "timed-out")
            case StepTaken():
                return kind == "step" and event.step == which and event.outcome in self.outcomes(which)
            case BreakTaken():
                return (kind, which) == ("break", event.query_index)
            case AnswerTakenBack():
                return event.query_index == self.last_answered
            case AnswerGiven():
                is_asked = (kind, which) == ("query", event.query_index) and self.is_prepared
                return is_asked and event.choice in (*SIGNS, Choice.SKIP)
        is_next = kind in ("query", "break") and which == event.query_index and not self.is_prepared
        return is_next and event.phase is PHASES[which]

    def outcomes(self, step):
        if step != 1:
            return OUTCOMES[step]
        return {"done", "failed" if self.n_tries == CHANCES - 1 else "again"}

    def take(self, event):
        match event:
            case SessionBegun():
                self.go_on()
            case SessionEnded():
                self.ending = str(event.ending)
            case StepTaken(outcome="again"):
                self.n_tries += 1
            case StepTaken(outcome="done"):
                self.go_on()
            case StepTaken():
                self.ending = str(event.outcome)
            case BreakTaken():
                self.breaks.add(event.query_index)
                self.at += 1
            case AnswerGiven():
                self.answers.append(event.choice)
                self.is_prepared = False
                self.go_on()
                self.last_answered = event.query_index if STATIONS[self.at][0] in ("query", "break") else None
            case AnswerTakenBack():
                self.answers.pop()
                self.is_prepared, self.last_answered = True, None
                self.at = STATIONS.index(("query", event.query_index))
            case LanguageChosen():
                pass
            case _:
                self.is_prepared = True

    def go_on(self):
        self.at += 1
        kind, which = STATIONS[self.at]
        if kind == "break" and which in self.breaks:
            self.at += 1
        if kind == "step":
            self.last_answered = None
        if kind == "end":
            self.ending = "completed"

    @property
    def action(self):
        kind = "end" if self.ending is not None else STATIONS[self.at][0]
        if kind == "query":
            return Action.ASK if self.is_prepared else Action.PREPARE
        return {
            "welcome": Action.WELCOME,
            "step": Action.STEP,
            "break": Action.BREAK,
            "end": Action.FINISHED,
        }[kind]

    def legal_event(self, choice):
        kind, which = STATIONS[self.at]
        if kind == "welcome":
            return SessionBegun(1)
        if kind == "step":
            return StepTaken(which, StepOutcome.DONE)
        if kind == "break":
            return BreakTaken(which)
        return AnswerGiven(which, choice, 900) if self.is_prepared else prepared(which, PHASES[which])


# Made beforehand: the shape checks of the core draw random numbers, which Hypothesis forbids inside a strategy.
INDICES = range(N + 1)
GOES_ON = [
    SessionBegun(1),
    LanguageChosen("en"),
    LanguageChosen("de"),
    *(prepared(index, phase) for index in INDICES for phase in Phase),
    *(AnswerGiven(index, choice, 5) for index in INDICES for choice in Choice),
    *(AnswerTakenBack(index) for index in INDICES),
    *(BreakTaken(index) for index in INDICES),
    *(StepTaken(step, outcome) for step in range(6) for outcome in (StepOutcome.DONE, StepOutcome.AGAIN)),
]
ENDS = [
    *(SessionEnded(ending) for ending in Ending),
    *(StepTaken(step, outcome) for step in range(6) for outcome in StepOutcome),
]
CHOICES = st.sampled_from([*SIGNS, Choice.SKIP])


def check(state, model):
    assert next_action(STUDY, state) is model.action
    assert [given.choice for given in state.answers] == model.answers
    assert state.ending == model.ending
    assert can_take_back(STUDY, state) == (model.last_answered is not None and model.ending is None)
    said = [
        SIGNS[choice]
        for choice, phase in zip(model.answers, PHASES, strict=False)
        if phase is Phase.ACTIVE and choice in SIGNS
    ]
    assert state.comparisons.signs.tolist() == said
    is_at_step = model.action is Action.STEP
    if is_at_step:
        assert state.step == STATIONS[model.at][1]
    assert (current_step(STUDY, state) is None) == (model.action in (Action.WELCOME, Action.FINISHED))


def offer(state, model, event):
    if not model.accepts(event):
        with pytest.raises(SessionError, match=r"^Expected "):
            apply(STUDY, state, event)
        return state
    after = apply(STUDY, state, event)
    model.take(event)
    assert after.n_events == state.n_events + 1
    return after


def reached(ways):
    """States of a walk along legal events, with their models and the log up to each."""
    state, model, log = initial_state(STUDY), Model(), []
    for strays, choice in ways:
        yield state, model, log
        for event in strays:
            is_legal = model.accepts(event)
            state = offer(state, model, event)
            log += [event] * is_legal
            yield state, model, log
        if model.ending is None:
            event = model.legal_event(choice)
            log.append(event)
            state = offer(state, model, event)
    yield state, model, log


N_STATIONS = 2 * N + 10
WAYS = st.lists(
    st.tuples(st.lists(st.sampled_from(GOES_ON), max_size=3), CHOICES),
    min_size=N_STATIONS,
    max_size=N_STATIONS,
)


@given(ways=WAYS, ends=st.lists(st.sampled_from(ENDS), max_size=2), ends_at=st.integers(0, N_STATIONS))
def test_the_session_goes_where_the_model_goes_and_refuses_what_the_model_refuses(ways, ends, ends_at):
    ways = [*ways[:ends_at], (ends, Choice.A), *ways[ends_at:]]
    for walk in reached(ways):
        state, model, log = walk
        check(state, model)
    again = reduce(STUDY, log)
    check(again, model)
    assert again.n_events == len(log)


@given(
    backs=st.lists(st.booleans(), min_size=N, max_size=N),
    choices=st.lists(CHOICES, min_size=2 * N, max_size=2 * N),
)
def test_every_answer_taken_back_once_and_given_again_leads_to_the_end(backs, choices):
    state, model, given = initial_state(STUDY), Model(), iter(choices)
    taken_back = set()
    while model.ending is None:
        event = model.legal_event(next(given) if model.action is Action.ASK else Choice.A)
        state = offer(state, model, event)
        last = model.last_answered
        if isinstance(event, AnswerGiven) and last is not None and backs[last] and last not in taken_back:
            taken_back.add(last)
            state = offer(state, model, AnswerTakenBack(last))
        check(state, model)
    assert state.ending is Ending.COMPLETED
    assert len(state.answers) == len(state.prepared) == N


def walked(study, until):
    """The log of somebody who does what comes next, up to the first event that `until` is true of, without it."""
    model, log, state = Model(), [], initial_state(study)
    while model.ending is None:
        event = model.legal_event(Choice.A)
        if until(event):
            return log, state
        log.append(event)
        state = apply(study, state, event)
        model.take(event)
    return log, state


def same(first, second):
    """Whether two states are the same but for the length of their logs, arrays bit for bit."""
    names = (
        "participant",
        "answers",
        "prepared",
        "n_queries_learned",
        "step",
        "n_tries",
        "last_break",
        "ending",
    )
    return (
        all(getattr(first, name) == getattr(second, name) for name in names)
        and first.knowledge == second.knowledge
        and np.array_equal(first.comparisons.feature_diffs, second.comparisons.feature_diffs)
        and np.array_equal(first.comparisons.signs, second.comparisons.signs)
    )


def test_taking_an_answer_back_leads_to_the_state_before_it_and_forgets_what_was_learned_after():
    query = prepared(N_PRACTICE + 1, PHASES[N_PRACTICE + 1])
    log, before = walked(
        STUDY, lambda event: isinstance(event, AnswerGiven) and event.query_index == N_PRACTICE
    )
    after = reduce(
        STUDY,
        [
            *log,
            AnswerGiven(N_PRACTICE, Choice.B, 5),
            FeatureLearned(N_PRACTICE + 1, 3, learned_feature(), "0.1.0"),
            query,
            LanguageChosen("en"),
        ],
    )
    assert after.knowledge.feature is not None
    back = apply(STUDY, after, AnswerTakenBack(N_PRACTICE))
    assert same(back, before)
    assert back.knowledge == Knowledge(None, None)
    assert (back.n_events, back.language) == (after.n_events + 1, "en")


def test_an_answer_is_taken_back_only_where_the_study_allows_it():
    log, state = walked(FIRM, lambda event: isinstance(event, AnswerGiven) and event.query_index == 1)
    answered = apply(FIRM, apply(FIRM, state, AnswerGiven(1, Choice.A, 5)), StepTaken(1, StepOutcome.DONE))
    assert not can_take_back(FIRM, answered)
    with pytest.raises(SessionError, match="Expected the last answer"):
        apply(FIRM, reduce(FIRM, [*log, AnswerGiven(1, Choice.A, 5)]), AnswerTakenBack(1))


def test_the_check_has_its_chances_and_no_more():
    log, _ = walked(STUDY, lambda event: isinstance(event, StepTaken) and event.step == 1)
    again = [StepTaken(1, StepOutcome.AGAIN)] * (CHANCES - 1)
    assert reduce(STUDY, [*log, *again]).ending is None
    assert reduce(STUDY, [*log, *again, StepTaken(1, StepOutcome.FAILED)]).ending is Ending.FAILED
    assert reduce(STUDY, [*log, *again, StepTaken(1, StepOutcome.DONE)]).step == 2
    with pytest.raises(SessionError):
        reduce(STUDY, [*log, *again, StepTaken(1, StepOutcome.AGAIN)])
    with pytest.raises(SessionError):
        reduce(STUDY, [*log, StepTaken(1, StepOutcome.FAILED)])


def test_what_was_said_in_the_steps_is_kept_with_every_try():
    log, _ = walked(STUDY, lambda event: isinstance(event, StepTaken) and event.step == 1)
    tries = [
        StepTaken(1, StepOutcome.AGAIN, {"answers": {"which": 3}}),
        StepTaken(1, StepOutcome.DONE, {"answers": 2}),
    ]
    state = reduce(STUDY, [*log, *tries])
    assert state.taken[1:] == tuple(tries)


def test_people_before_are_started_from_before_any_step_and_never_later():
    population = PopulationPrior(np.ones(4), np.eye(4))
    adopted = PopulationAdopted(0, "key", ("one",), population)
    assert reduce(STUDY, [SessionBegun(1), adopted]).knowledge.population is population
    log, _ = walked(STUDY, lambda event: isinstance(event, AnswerGiven))
    for early_or_late in ([], log):
        with pytest.raises(SessionError, match="people before"):
            reduce(STUDY, [*early_or_late, adopted])


def test_an_answer_after_the_end_is_not_current():
    for ending in (Ending.STOPPED, Ending.TIMED_OUT):
        _, state = walked(STUDY, lambda event: isinstance(event, AnswerGiven))
        ended = apply(STUDY, state, SessionEnded(ending))
        assert (ended.ending, ended.current) == (ending, None)
        with pytest.raises(AnswerNotCurrentError):
            apply(STUDY, ended, AnswerGiven(0, Choice.A, 5))
