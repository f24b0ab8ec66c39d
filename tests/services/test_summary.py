"""What a session's summary says about the test answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.services.summary import test_accuracy as accuracy_of_session
from app.settings import find_study
from study_core.comparison import Choice, ComparisonSet, Query
from study_core.events import AnswerGiven, QueryPrepared
from study_core.knowledge import Knowledge
from study_core.plan import Phase
from study_core.session import SessionState
from tests.study_core.made_up import learned_feature, prepared


def state_of(choices: list[tuple[Phase, Choice]]) -> SessionState:
    queries = tuple(prepared(index, phase) for index, (phase, _) in enumerate(choices))
    answers = tuple(AnswerGiven(index, choice, 500) for index, (_, choice) in enumerate(choices))
    return SessionState(0, 1, queries, answers, ComparisonSet.empty(4))


def better(query: Query, weights: np.ndarray) -> Choice:
    return Choice.A if float((query.features_a - query.features_b) @ weights) > 0.0 else Choice.B


STUDY = find_study("quickstart")
WEIGHTS = np.array([0.4, 0.3, 0.2, 0.1])


def predicted(index: int) -> Choice:
    made: QueryPrepared = prepared(index, Phase.TEST)
    return better(made.proposed.query, WEIGHTS)


def other(choice: Choice) -> Choice:
    return Choice.B if choice is Choice.A else Choice.A


def test_only_test_answers_count() -> None:
    state = state_of(
        [(Phase.ACTIVE, other(predicted(0))), (Phase.TEST, predicted(1)), (Phase.TEST, predicted(2))]
    )
    assert accuracy_of_session(STUDY, state, WEIGHTS) == 1.0


def test_a_wrong_one_counts_nothing_and_what_prefers_neither_not_at_all() -> None:
    choices = [predicted(0), other(predicted(1)), Choice.SAME, Choice.SKIP, Choice.UNSURE]
    state = state_of([(Phase.TEST, choice) for choice in choices])
    assert accuracy_of_session(STUDY, state, WEIGHTS) == 0.5


def test_a_reward_difference_of_zero_is_half_a_hit() -> None:
    state = state_of([(Phase.TEST, Choice.A)])
    assert accuracy_of_session(STUDY, state, np.zeros(4)) == 0.5


def test_without_test_answers_there_is_no_accuracy() -> None:
    assert accuracy_of_session(STUDY, state_of([(Phase.ACTIVE, Choice.A)]), WEIGHTS) is None
    assert accuracy_of_session(STUDY, state_of([(Phase.TEST, Choice.SKIP)]), WEIGHTS) is None


def test_a_learned_feature_counts_as_well() -> None:
    state = state_of([(Phase.TEST, Choice.A), (Phase.TEST, Choice.A)])
    feature = learned_feature()
    knowing = replace(state, knowledge=Knowledge(None, feature))
    queries = [one.proposed.query for one in state.prepared]
    of_each = [
        feature.of_trajectories(
            STUDY.domain, STUDY.domain.rollout(np.stack([one.controls_a, one.controls_b]))
        )
        for one in queries
    ]
    expected = np.mean([of_a > of_b for of_a, of_b in of_each])
    assert accuracy_of_session(STUDY, knowing, np.array([0.0, 0.0, 0.0, 0.0, 1.0])) == expected
