"""The session against a model of its own: what is legal, where it leads, and what the posterior gets to see."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study_core.comparison import Choice
from study_core.errors import AnswerNotCurrentError, SessionError
from study_core.events import AnswerGiven, FeatureLearned, PopulationAdopted, SessionBegun
from study_core.knowledge import NOTHING, Knowledge
from study_core.learning import FeatureDue, compared, feature_due
from study_core.plan import Phase
from study_core.posterior.population import PopulationPrior
from study_core.session import Action, apply, initial_state, next_action, query_of, reduce
from study_core.study import parse_study
from tests.study_core.made_up import learned_feature, prepared
from tests.study_core.references import study_text

N_ACTIVE, N_TEST = 3, 2
N = N_ACTIVE + N_TEST
STUDY = parse_study(
    study_text(
        protocol__active_queries=N_ACTIVE,
        protocol__test_queries=N_TEST,
        response__answers=["a", "b", "skip"],
    )
)
SIGNS = {Choice.A: 1.0, Choice.B: -1.0}

# Made beforehand: the shape checks of the core draw random numbers, which Hypothesis forbids inside a strategy.
EVENTS = st.one_of(
    st.sampled_from([SessionBegun(1), SessionBegun(2)]),
    st.sampled_from([prepared(index, phase) for index in range(N + 1) for phase in Phase]),
    st.sampled_from([AnswerGiven(index, choice, 5) for index in range(N + 1) for choice in Choice]),
)
CHOICES = st.lists(st.sampled_from([*SIGNS, Choice.SKIP]), min_size=N, max_size=N)


@dataclass
class Model:
    """What should be true of a session, kept as three numbers."""

    has_begun: bool = False
    n_prepared: int = 0
    n_answered: int = 0

    def accepts(self, event):
        if isinstance(event, SessionBegun):
            return not self.has_begun
        if isinstance(event, AnswerGiven):
            is_current = self.n_prepared > self.n_answered == event.query_index
            return is_current and event.choice in (*SIGNS, Choice.SKIP)
        is_next = event.query_index == self.n_answered == self.n_prepared < N
        belongs = event.phase is (Phase.ACTIVE if event.query_index < N_ACTIVE else Phase.TEST)
        return self.has_begun and is_next and belongs

    def take(self, event):
        if isinstance(event, SessionBegun):
            self.has_begun = True
        elif isinstance(event, AnswerGiven):
            self.n_answered += 1
        else:
            self.n_prepared += 1

    @property
    def action(self):
        if not self.has_begun:
            return Action.WELCOME
        if self.n_prepared > self.n_answered:
            return Action.ASK
        return Action.FINISHED if self.n_answered == N else Action.PREPARE


def legal_event(model, choice):
    if not model.has_begun:
        return SessionBegun(1)
    if model.n_prepared > model.n_answered:
        return AnswerGiven(model.n_answered, choice, 900)
    index = model.n_answered
    return prepared(index, Phase.ACTIVE if index < N_ACTIVE else Phase.TEST)


def whole_log(choices):
    log = [SessionBegun(1)]
    for index, choice in enumerate(choices):
        phase = Phase.ACTIVE if index < N_ACTIVE else Phase.TEST
        log += [prepared(index, phase), AnswerGiven(index, choice, 700 + index)]
    return log


def same(first, second):
    """Equality of states, arrays bit for bit."""
    return (
        (first.n_events, first.participant, first.answers)
        == (second.n_events, second.participant, second.answers)
        and [event.query_index for event in first.prepared]
        == [event.query_index for event in second.prepared]
        and np.array_equal(first.comparisons.feature_diffs, second.comparisons.feature_diffs)
        and np.array_equal(first.comparisons.signs, second.comparisons.signs)
    )


@given(strays=st.lists(st.lists(EVENTS, max_size=4), min_size=2 * N + 1, max_size=2 * N + 1), choices=CHOICES)
def test_whatever_else_is_tried_legal_events_lead_to_the_end_and_illegal_ones_raise(strays, choices):
    model, state = Model(), initial_state(STUDY)

    def offer(event):
        nonlocal state
        before = state
        if model.accepts(event):
            state = apply(STUDY, state, event)
            model.take(event)
            assert state.n_events == before.n_events + 1
        else:
            with pytest.raises(SessionError):
                apply(STUDY, state, event)
            assert state is before

    for tried in strays:
        for event in tried:
            offer(event)
            assert next_action(STUDY, state) is model.action
        if model.action is not Action.FINISHED:
            offer(legal_event(model, choices[model.n_answered]))
        assert next_action(STUDY, state) is model.action
        assert state.query_index == model.n_answered
    while model.action is not Action.FINISHED:
        offer(legal_event(model, choices[model.n_answered]))
    assert next_action(STUDY, state) is Action.FINISHED
    assert len(state.answers) == len(state.prepared) == N
    assert state.n_events == 2 * N + 1
    assert len(state.comparisons) == sum(answer.choice in SIGNS for answer in state.answers[:N_ACTIVE])


@given(choices=CHOICES, cut=st.integers(0, 2 * N))
def test_reducing_a_prefix_and_applying_the_rest_is_reducing_it_all(choices, cut):
    log = whole_log(choices)
    state = reduce(STUDY, log[:cut])
    state = apply(STUDY, state, log[cut])
    assert same(state, reduce(STUDY, log[: cut + 1]))


@given(choices=CHOICES)
def test_the_posterior_sees_every_active_preference_and_no_skip_and_no_test_answer(choices):
    state = reduce(STUDY, whole_log(choices))
    preferred = [index for index in range(N_ACTIVE) if choices[index] in SIGNS]
    queries = [prepared(index).proposed.query for index in preferred]
    expected = [query.features_a - query.features_b for query in queries]
    np.testing.assert_array_equal(state.comparisons.feature_diffs, np.reshape(expected, (-1, 4)))
    np.testing.assert_array_equal(state.comparisons.signs, [SIGNS[choices[index]] for index in preferred])
    assert [answer.choice for answer in state.answers] == choices


@given(choices=CHOICES)
def test_changing_a_test_answer_changes_nothing_the_posterior_sees(choices):
    other = [
        *choices[:N_ACTIVE],
        *(Choice.A if choice is Choice.B else Choice.B for choice in choices[N_ACTIVE:]),
    ]
    first, second = (reduce(STUDY, whole_log(given)).comparisons for given in (choices, other))
    np.testing.assert_array_equal(first.signs, second.signs)
    np.testing.assert_array_equal(first.feature_diffs, second.feature_diffs)


def test_a_state_is_never_changed_by_what_comes_after_it():
    log = whole_log([Choice.A] * N)
    states = [reduce(STUDY, log[:cut]) for cut in range(len(log) + 1)]
    running = initial_state(STUDY)
    for event, kept in zip(log, states, strict=False):
        assert same(running, kept)
        running = apply(STUDY, running, event)
    assert same(initial_state(STUDY), states[0])


def test_the_current_query_is_the_one_prepared_and_not_yet_answered():
    log = whole_log([Choice.B] * N)
    assert reduce(STUDY, log[:1]).current is None
    assert reduce(STUDY, log[:2]).current is log[1]
    assert reduce(STUDY, log[:3]).current is None
    assert reduce(STUDY, log[:4]).current is log[3]
    assert query_of(reduce(STUDY, log), 1) is log[3].proposed.query


def test_beginning_names_the_participant():
    assert initial_state(STUDY).participant is None
    assert reduce(STUDY, [SessionBegun(17)]).participant == 17
    assert reduce(STUDY, [SessionBegun("rehearsal")]).participant == "rehearsal"


def test_what_is_learned_is_known_from_then_on_and_a_training_that_diverged_changes_nothing():
    population = PopulationAdopted(0, "key", ("one",), PopulationPrior(np.ones(4), np.eye(4)))
    first, second = learned_feature(seed=1), learned_feature(seed=2)
    state = reduce(STUDY, [BEGUN, population, FIRST, ANSWERED])
    assert state.knowledge == Knowledge(population.population, None)
    state = apply(STUDY, state, FeatureLearned(1, 1, first, "0.1.0"))
    assert (state.knowledge.feature, state.n_queries_learned) == (first, 1)
    diverged = apply(STUDY, state, FeatureLearned(1, 2, None, "0.1.0"))
    assert (diverged.knowledge.feature, diverged.n_queries_learned) == (first, 2)
    replaced = apply(STUDY, diverged, FeatureLearned(1, 3, second, "0.1.0"))
    assert replaced.knowledge == Knowledge(population.population, second)
    taken_out = PopulationAdopted(0, "key", ("one",), None)
    assert reduce(STUDY, [BEGUN, taken_out, FIRST]).knowledge == NOTHING


LEARNING = parse_study(
    study_text(
        protocol__active_queries=20,
        protocol__test_queries=1,
        response__answers=["a", "b", "skip"],
        response__rationality="inferred",
        prior__support="sphere",
        learning__feature_every=15,
    )
)


DUE = FeatureDue(11, 15)


def log_of(choices):
    log = [SessionBegun(1)]
    for index, choice in enumerate(choices):
        log += [prepared(index), AnswerGiven(index, choice, 700)]
    return log


def test_a_feature_is_due_before_each_block_once_it_can_be_learned():
    state = reduce(LEARNING, log_of([Choice.A, Choice.B] * 8))
    assert [feature_due(LEARNING, state, index) for index in (9, 14, 15, 16, 20)] == [None, None, *[DUE] * 3]
    learned = apply(LEARNING, state, FeatureLearned(16, 11, learned_feature(), "0.1.0"))
    assert feature_due(LEARNING, learned, 20) is None
    assert feature_due(STUDY, reduce(STUDY, whole_log([Choice.A] * N)), N) is None


def test_no_feature_is_learned_from_fewer_than_ten_preferences():
    enough = reduce(LEARNING, log_of([Choice.SKIP] * 1 + [Choice.A] * 14))
    too_few = reduce(LEARNING, log_of([Choice.SKIP] * 2 + [Choice.A] * 13))
    assert (feature_due(LEARNING, enough, 15), feature_due(LEARNING, too_few, 15)) == (DUE, None)


def test_what_was_compared_is_what_the_posterior_sees_of_the_first_queries():
    choices = [Choice.A, Choice.SKIP, Choice.B, Choice.B, Choice.SKIP, Choice.A]
    state = reduce(LEARNING, log_of(choices))
    found = compared(state, 5)
    queries = [prepared(index).proposed.query for index in (0, 2, 3)]
    np.testing.assert_array_equal(found.comparisons.signs, [1.0, -1.0, -1.0])
    np.testing.assert_array_equal(found.comparisons.feature_diffs, [query.feature_diff for query in queries])
    np.testing.assert_array_equal(found.controls, [[query.controls_a, query.controls_b] for query in queries])


def test_no_test_answer_is_among_what_a_feature_is_learned_from():
    finished = reduce(STUDY, whole_log([Choice.A] * N))
    assert len(compared(finished, N).controls) == len(compared(finished, N).comparisons) == N_ACTIVE


BEGUN, FIRST = SessionBegun(1), prepared(0)
ANSWERED = AnswerGiven(0, Choice.A, 500)
FINISHED = whole_log([Choice.A] * N)

ILLEGAL = {
    "beginning twice": ([BEGUN], BEGUN, SessionError),
    "preparing before the beginning": ([], FIRST, SessionError),
    "answering before the beginning": ([], ANSWERED, AnswerNotCurrentError),
    "answering what was not asked": ([BEGUN], ANSWERED, AnswerNotCurrentError),
    "answering another query": ([BEGUN, FIRST], AnswerGiven(1, Choice.A, 500), AnswerNotCurrentError),
    "answering twice": ([BEGUN, FIRST, ANSWERED], ANSWERED, AnswerNotCurrentError),
    "preparing two at once": ([BEGUN, FIRST], prepared(1), SessionError),
    "preparing one twice": ([BEGUN, FIRST], FIRST, SessionError),
    "preparing one again": ([BEGUN, FIRST, ANSWERED], FIRST, SessionError),
    "leaving one out": ([BEGUN, FIRST, ANSWERED], prepared(2), SessionError),
    "a test query among the active ones": ([BEGUN], prepared(0, Phase.TEST), SessionError),
    "an active query among the test ones": (FINISHED[: 2 * N_ACTIVE + 1], prepared(N_ACTIVE), SessionError),
    "one query too many": (FINISHED, prepared(N, Phase.TEST), SessionError),
    "an answer that the study does not offer": (
        [BEGUN, FIRST],
        AnswerGiven(0, Choice.SAME, 500),
        SessionError,
    ),
    "learning while a query is asked": ([BEGUN, FIRST], FeatureLearned(0, 1, None, "0.1.0"), SessionError),
    "learning for another query": ([BEGUN], FeatureLearned(1, 1, None, "0.1.0"), SessionError),
    "adopting before the beginning": ([], PopulationAdopted(0, "key", (), None), SessionError),
    "learning after the end": (FINISHED, FeatureLearned(N, 1, None, "0.1.0"), SessionError),
    "one answer too many": (FINISHED, AnswerGiven(N, Choice.A, 5), AnswerNotCurrentError),
}


@pytest.mark.parametrize("case", ILLEGAL)
def test_an_illegal_event_raises_and_says_what_was_expected(case):
    log, event, error = ILLEGAL[case]
    with pytest.raises(error, match=r"^Expected "):
        apply(STUDY, reduce(STUDY, log), event)
    with pytest.raises(error):
        reduce(STUDY, [*log, event])
