"""Accuracy counts what the sign of w . psi predicts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study_core.comparison import ComparisonSet
from study_core.evaluation.metrics import accuracy


def test_accuracy_is_the_share_of_signs_that_agree():
    comparisons = ComparisonSet(
        np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0], [2.0, -0.5]]), np.array([1.0, -1.0, -1.0, 1.0])
    )
    assert accuracy(np.array([1.0, 1.0]), comparisons) == 0.75


def test_a_tie_counts_half():
    comparisons = ComparisonSet(np.array([[1.0, -1.0], [1.0, 0.0]]), np.array([1.0, 1.0]))
    assert accuracy(np.array([1.0, 1.0]), comparisons) == 0.75
    assert accuracy(np.zeros(2), comparisons) == 0.5


@given(seed=st.integers(0, 10**6))
def test_opposite_weights_have_the_opposite_accuracy(seed):
    rng = np.random.default_rng(seed)
    comparisons = ComparisonSet(rng.normal(size=(9, 4)), rng.choice([-1.0, 1.0], 9))
    weights = rng.random(4)
    assert accuracy(weights, comparisons) + accuracy(-weights, comparisons) == pytest.approx(1.0)
    assert accuracy(weights, comparisons) == accuracy(7.0 * weights, comparisons)


def test_no_answers_have_no_accuracy():
    with pytest.raises(ValueError, match="at least one answer"):
        accuracy(np.ones(4), ComparisonSet.empty(4))
