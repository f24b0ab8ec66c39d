"""Comparisons keep the order and the sign of what was asked and answered."""

import numpy as np

from study_core.comparison import Choice, ComparisonSet, Query


def query(features_a, features_b):
    return Query(np.zeros(2), np.ones(2), np.array(features_a), np.array(features_b))


def test_the_feature_difference_is_a_minus_b():
    np.testing.assert_array_equal(query([3.0, 1.0], [1.0, 4.0]).feature_diff, [2.0, -3.0])


def test_preferring_a_is_plus_one_and_preferring_b_is_minus_one():
    assert [Choice.A.sign, Choice.B.sign] == [1.0, -1.0]
    assert [Choice("a"), Choice("b")] == [Choice.A, Choice.B]


def test_preferred_differences_are_preferred_minus_other_whatever_was_chosen():
    comparisons = ComparisonSet.empty(2)
    comparisons = comparisons.append(query([3.0, 1.0], [1.0, 4.0]), Choice.A)
    comparisons = comparisons.append(query([5.0, 0.0], [6.0, 2.0]), Choice.B)
    np.testing.assert_array_equal(comparisons.feature_diffs, [[2.0, -3.0], [-1.0, -2.0]])
    np.testing.assert_array_equal(comparisons.signs, [1.0, -1.0])
    np.testing.assert_array_equal(comparisons.preferred_diffs, [[2.0, -3.0], [1.0, 2.0]])


def test_adding_an_answer_leaves_the_earlier_set_as_it_was():
    before = ComparisonSet.empty(2).append(query([1.0, 0.0], [0.0, 1.0]), Choice.B)
    after = before.append(query([2.0, 0.0], [0.0, 1.0]), Choice.A)
    assert (len(ComparisonSet.empty(2)), len(before), len(after)) == (0, 1, 2)
    np.testing.assert_array_equal(after.feature_diffs[:1], before.feature_diffs)


def test_about_the_same_is_kept_and_prefers_neither():
    after = ComparisonSet.empty(2).append(query([3.0, 1.0], [1.0, 4.0]), Choice.SAME)
    np.testing.assert_array_equal(after.feature_diffs, [[2.0, -3.0]])
    np.testing.assert_array_equal(after.signs, [0.0])


def test_cannot_tell_and_skip_leave_the_set_as_it_is():
    before = ComparisonSet.empty(2).append(query([1.0, 0.0], [0.0, 1.0]), Choice.B)
    for choice in (Choice.UNSURE, Choice.SKIP):
        assert not choice.is_informative
        assert before.append(query([2.0, 0.0], [0.0, 1.0]), choice) is before
