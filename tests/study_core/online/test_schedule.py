"""When a feature is learned, and from what."""

import pytest

from study_core.online.schedule import LEAD, n_learned_from


@pytest.mark.parametrize(
    ("query_index", "expected"),
    [(0, 0), (9, 0), (10, 6), (11, 6), (19, 6), (20, 16), (29, 16), (30, 26), (34, 26), (35, 26), (60, 26)],
)
def test_each_block_has_the_feature_of_the_answers_until_shortly_before_it(query_index, expected):
    assert LEAD == 4
    assert n_learned_from(10, 35, query_index) == expected


def test_the_last_posterior_has_a_feature_of_its_own_where_a_block_ends_with_the_active_queries():
    assert n_learned_from(10, 40, 39) == 26
    assert n_learned_from(10, 40, 40) == 36
    assert n_learned_from(10, 40, 55) == 36


def test_nothing_is_learned_in_a_session_shorter_than_a_block():
    assert {n_learned_from(50, 30, index) for index in range(40)} == {0}
