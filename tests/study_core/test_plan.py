"""Where queries stand in a session and where their trajectories stand on the screen, over many seeded sessions."""

from collections import Counter
from itertools import groupby

import numpy as np
import pytest
from scipy import stats

from study_core.comparison import Choice
from study_core.plan import Phase, Position, choice_at, plan_of, position_of
from study_core.study import parse_study
from tests.study_core.references import study_text

PRACTICE = '\n[[path]]\nstep = "practice"\nqueries = 3\n\n[[path]]\nstep = "queries"\n'


def study(n_active=30, n_test=12, repeats=6, checks=3, seed=5, path=PRACTICE):
    numbers = {"active_queries": n_active, "test_queries": n_test, "repeats": repeats, "checks": checks}
    changes = {f"protocol__{name}": number for name, number in numbers.items()}
    return parse_study(study_text(seed=seed, text__practice="Try it.", **changes) + path)


STUDY = study()
N_PRACTICE, N_MAIN, N_TEST = 3, 30 + 6 + 3, 12
PEOPLE = range(1, 501)
PLANS = [plan_of(STUDY, person) for person in PEOPLE]


def sides(plan):
    return [slot.first_shown for slot in plan.slots]


def longest_run(values):
    return max(len(list(group)) for _, group in groupby(values))


def test_no_side_is_shown_first_more_than_three_times_in_a_row():
    runs = [longest_run(sides(plan)) for plan in PLANS]
    assert max(runs) == 3
    # Three in a row do come: who counts along can't know the next side.
    assert runs.count(3) > 400


def test_every_session_has_both_sides_equally_often():
    for plan in PLANS:
        counts = Counter(sides(plan))
        assert abs(counts[Choice.A] - counts[Choice.B]) <= 2
        for start in range(0, len(plan) - 3, 4):
            assert sides(plan)[start : start + 4].count(Choice.A) == 2


def test_at_every_place_both_sides_are_equally_likely():
    n_first = np.sum([[side is Choice.A for side in sides(plan)] for plan in PLANS], axis=0)
    # 54 places at a level of 5 % together.
    low, high = stats.binom(len(PLANS), 0.5).interval(1 - 0.05 / len(n_first))
    assert low <= n_first.min()
    assert n_first.max() <= high


@pytest.mark.parametrize("before", [(), ("A",), ("A", "B"), ("A", "A"), ("B", "B", "A")])
def test_what_came_before_hardly_tells_the_next_side(before):
    following = Counter()
    for plan in PLANS:
        shown = [side.name for side in sides(plan)]
        for i in range(len(before), len(shown)):
            if tuple(shown[i - len(before) : i]) == before:
                following[shown[i]] += 1
    # Two at a side are often the half of a balanced four; nobody who takes part knows which of the two is A.
    assert min(following.values()) / following.total() > 0.15


def test_a_session_has_so_many_queries_of_each_kind_and_in_this_order():
    for plan in PLANS:
        phases = [slot.phase for slot in plan.slots]
        assert phases[:N_PRACTICE] == [Phase.PRACTICE] * N_PRACTICE
        assert phases[N_PRACTICE + N_MAIN :] == [Phase.TEST] * N_TEST
        assert Counter(phases[N_PRACTICE:-N_TEST]) == {Phase.ACTIVE: 30, Phase.REPEAT: 6, Phase.CHECK: 3}
        for phase in Phase:
            numbers = [slot.number for slot in plan.slots if slot.phase is phase]
            assert numbers == list(range(len(numbers)))
    assert STUDY.first_test == N_PRACTICE + N_MAIN
    assert STUDY.n_queries == len(PLANS[0]) == N_PRACTICE + N_MAIN + N_TEST


def repeats(plan):
    return {i: slot.repeat_of for i, slot in enumerate(plan.slots) if slot.phase is Phase.REPEAT}


def test_a_repeat_shows_an_active_query_again_with_its_sides_swapped_and_ten_queries_later():
    for plan in PLANS:
        found = repeats(plan)
        assert len(found) == len(set(found.values())) == 6
        for place, first in found.items():
            assert plan.slots[first].phase is Phase.ACTIVE
            assert plan.slots[place].first_shown is not plan.slots[first].first_shown
            assert place - first >= 10
        others = [slot.repeat_of for slot in plan.slots if slot.phase is not Phase.REPEAT]
        assert others == [None] * (len(plan) - 6)


def test_repeats_and_what_they_repeat_come_anywhere():
    places = Counter(place for plan in PLANS for place in repeats(plan))
    firsts = Counter(first for plan in PLANS for first in repeats(plan).values())
    # All but the first ten, where nothing is ten queries back.
    assert set(places) == set(range(N_PRACTICE + 10, N_PRACTICE + N_MAIN))
    assert set(firsts) == set(range(N_PRACTICE, N_PRACTICE + N_MAIN - 10))


def test_a_check_is_never_the_first_query_that_counts_and_tells_a_position():
    places, told = Counter(), Counter()
    for plan in PLANS:
        for place, slot in enumerate(plan.slots):
            assert (slot.phase is Phase.CHECK) == (slot.instructed is not None)
            if slot.instructed is not None:
                places[place] += 1
                told[slot.instructed, slot.first_shown] += 1
    assert set(places) == set(range(N_PRACTICE + 1, N_PRACTICE + N_MAIN))
    # Whether the first or the second is to be chosen says nothing about what stands there.
    assert set(told) == {(position, side) for position in Position for side in (Choice.A, Choice.B)}
    assert stats.chisquare(list(told.values())).pvalue > 0.001


def test_the_same_person_has_the_same_plan_and_another_person_or_seed_another():
    again = study(path=PRACTICE + "# read anew\n")
    assert again is not STUDY
    assert [plan_of(again, person) for person in PEOPLE[:20]] == PLANS[:20]
    assert len({plan.slots for plan in PLANS}) == len(PLANS)
    assert plan_of(study(seed=6), 1) != PLANS[0]
    assert plan_of(STUDY, "1") != PLANS[0]


def test_a_study_without_a_path_has_active_and_test_queries_with_sides_of_every_balanced_kind():
    alone = parse_study(study_text())
    assert [slot.phase for slot in plan_of(alone, 1).slots] == [Phase.ACTIVE] * 3 + [Phase.TEST] * 2
    # Six ways to show two of four at a side, and two sides for the fifth query.
    assert len({tuple(sides(plan_of(alone, person))) for person in PEOPLE}) == 12


@pytest.mark.parametrize(
    ("n_active", "n_repeats", "n_checks"),
    [(2, 1, 0), (2, 1, 1), (3, 1, 1), (4, 2, 2), (10, 5, 5), (100, 50, 50)],
)
def test_as_many_repeats_and_checks_as_are_allowed_find_their_places(n_active, n_repeats, n_checks):
    crowded = study(n_active, 0, n_repeats, n_checks, path="")
    for person in PEOPLE[:100]:
        plan = plan_of(crowded, person)
        assert Counter(slot.phase for slot in plan.slots) == Counter(
            {Phase.ACTIVE: n_active, Phase.REPEAT: n_repeats, Phase.CHECK: n_checks}
        )
        assert all(place - first >= 2 for place, first in repeats(plan).items())
        assert plan.slots[0].phase is Phase.ACTIVE


def test_a_posterior_is_needed_before_every_active_query_and_after_the_last():
    for plan in PLANS[:50]:
        needing = [i for i in range(len(plan)) if plan.needs_posterior(i)]
        active = [i for i, slot in enumerate(plan.slots) if slot.phase is Phase.ACTIVE]
        assert needing == [*active, STUDY.first_test]
        assert [plan.n_active_before(i) for i in range(len(plan))] == [
            sum(other < i for other in active) for i in range(len(plan))
        ]
        assert [plan.index_of_active(number) for number in range(32)] == [*active, *[STUDY.first_test] * 2]


def test_without_test_queries_what_follows_the_last_is_where_the_last_posterior_would_be():
    plan = plan_of(study(n_test=0), 1)
    assert plan.index_of_active(30) == len(plan)
    assert plan.needs_posterior(len(plan))


@pytest.mark.parametrize("first", [Choice.A, Choice.B])
def test_positions_and_trajectories_lead_to_each_other(first):
    second = Choice.B if first is Choice.A else Choice.A
    assert (choice_at(first, Position.FIRST), choice_at(first, Position.SECOND)) == (first, second)
    assert (position_of(first, first), position_of(first, second)) == (Position.FIRST, Position.SECOND)
    for silent in (Choice.SAME, Choice.UNSURE, Choice.SKIP):
        assert position_of(first, silent) is None
    assert position_of(None, first) is None
