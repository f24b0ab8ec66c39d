"""What predictors learn from: the answers of one phase that stand, each with the query that it was given to."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.comparison import Choice
from study_core.domain import domain_named
from study_core.events import AnswerGiven, AnswerTakenBack, BreakTaken, SessionBegun
from study_core.plan import Phase
from study_core.preferences import preferences
from tests.study_core.made_up import prepared, proposed

DRIVING = domain_named("driving-v1")
PHASES = [
    Phase.PRACTICE,
    Phase.ACTIVE,
    Phase.CHECK,
    Phase.ACTIVE,
    Phase.REPEAT,
    Phase.ACTIVE,
    Phase.TEST,
    Phase.TEST,
]
CHOICES = [Choice.A, Choice.B, Choice.A, Choice.SAME, Choice.A, Choice.A, Choice.B, Choice.SKIP]


def log():
    events = [SessionBegun(1)]
    for index, (phase, choice) in enumerate(zip(PHASES, CHOICES, strict=True)):
        events += [prepared(index, phase), AnswerGiven(index, choice, 5)]
    return events


def expect(found, expected):
    """Expected are the queries and signs, in order."""
    pairs, signs = found
    assert signs.tolist() == [sign for _, sign in expected]
    for k, (query, _) in enumerate(expected):
        both = DRIVING.rollout(np.stack([query.controls_a, query.controls_b]))
        # How many are rolled out at once changes the last bits.
        np.testing.assert_allclose(pairs.states_a[k], both[0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(pairs.states_b[k], both[1], rtol=0, atol=1e-12)
    assert len(pairs.states_a) == len(pairs.states_b) == len(expected)


def query(index, seed=0):
    return proposed(index, seed=seed).query


def test_of_each_phase_come_its_own_preferences_and_no_others():
    expect(preferences(DRIVING, log(), Phase.ACTIVE), [(query(1), -1.0), (query(5), 1.0)])
    expect(preferences(DRIVING, log(), Phase.TEST), [(query(6), -1.0)])
    expect(preferences(DRIVING, [], Phase.ACTIVE), [])


@pytest.mark.parametrize("phase", [Phase.PRACTICE, Phase.CHECK, Phase.REPEAT, Phase.TEST])
def test_no_other_answer_moves_what_the_active_ones_teach(phase):
    # As if every answer that must not teach had been the other one.
    other = {Choice.A: Choice.B, Choice.B: Choice.A, Choice.SKIP: Choice.A}
    changed = [
        replace(event, choice=other[event.choice])
        if isinstance(event, AnswerGiven) and PHASES[event.query_index] is phase
        else event
        for event in log()
    ]
    expect(preferences(DRIVING, changed, Phase.ACTIVE), [(query(1), -1.0), (query(5), 1.0)])


def test_an_answer_taken_back_teaches_nothing_and_neither_does_the_query_after_it():
    start = [SessionBegun(1), prepared(0), AnswerGiven(0, Choice.A, 5), prepared(1)]
    expect(preferences(DRIVING, [*start, AnswerTakenBack(0)], Phase.ACTIVE), [])
    again = [*start, AnswerTakenBack(0), AnswerGiven(0, Choice.B, 5), prepared(1, seed=9)]
    expect(preferences(DRIVING, again, Phase.ACTIVE), [(query(0), -1.0)])
    # The query that was shown before the change of mind is not the one that was answered.
    whole = [*again, BreakTaken(1), AnswerGiven(1, Choice.A, 5)]
    expect(preferences(DRIVING, whole, Phase.ACTIVE), [(query(0), -1.0), (query(1, seed=9), 1.0)])


def test_the_same_answer_can_be_taken_back_more_than_once():
    events = [SessionBegun(1), prepared(0)]
    for choice in (Choice.A, Choice.B, Choice.A):
        events += [AnswerGiven(0, choice, 5), AnswerTakenBack(0)]
    expect(preferences(DRIVING, events, Phase.ACTIVE), [])
    expect(preferences(DRIVING, [*events, AnswerGiven(0, Choice.B, 5)], Phase.ACTIVE), [(query(0), -1.0)])
