"""Response models against the formulas written out with scipy, at every scale, and the early stop."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import log_expit

from study_core import choice_kernels
from study_core.choice import ResponseModel, ResponseParameters
from study_core.comparison import Choice, ComparisonSet
from tests.study_core import references

MODELS = [
    ResponseModel("sigmoid", 1.0),
    ResponseModel("sigmoid", 50.0),
    ResponseModel("sigmoid", 200.0, 0.1),
    ResponseModel("sigmoid", 10.0, 0.9),
    ResponseModel("clipped-linear", 1.0),
    ResponseModel("clipped-linear", 50.0),
]
# Up to three blocks of answers, with and without padding.
COUNTS = st.sampled_from([1, 2, 15, 16, 17, 31, 32, 40])


@st.composite
def answered(draw, n_features=4):
    n = draw(COUNTS)
    diffs = draw(arrays(np.float64, (n, n_features), elements=st.floats(-2.0, 2.0)))
    signs = draw(arrays(np.float64, n, elements=st.sampled_from([-1.0, 1.0])))
    return ComparisonSet(diffs, signs)


WEIGHTS = arrays(np.float64, (3, 4), elements=st.floats(0.0, 1.0))


def expected_log_likelihood(model, weights, comparisons):
    """By scipy, answer by answer."""
    u = model.rationality * (comparisons.feature_diffs @ weights.T) * comparisons.signs[:, None]
    if model.name == "clipped-linear":
        return np.minimum(u, 0.0).sum(axis=0)
    if model.lapse_rate == 0.0:
        return log_expit(u).sum(axis=0)
    return np.logaddexp(math.log(model.lapse_rate / 2), math.log1p(-model.lapse_rate) + log_expit(u)).sum(
        axis=0
    )


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(comparisons=answered(), weights=WEIGHTS)
def test_the_log_likelihood_is_the_formula(model, comparisons, weights):
    np.testing.assert_allclose(
        model.log_likelihood(weights, comparisons),
        expected_log_likelihood(model, weights, comparisons),
        rtol=1e-12,
        atol=1e-12,
    )


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_the_log_likelihood_agrees_with_the_other_reference_on_hundreds_of_answers(model):
    rng = np.random.default_rng(12)
    comparisons = ComparisonSet(rng.normal(0, 0.3, (333, 4)), rng.choice([-1.0, 1.0], 333))
    weights = rng.random((20, 4))
    terms = references.log_answer_probability(
        model.name, model.rationality, model.lapse_rate, comparisons.preferred_diffs @ weights.T
    )
    np.testing.assert_allclose(model.log_likelihood(weights, comparisons), terms.sum(axis=0), rtol=1e-12)


@pytest.mark.parametrize("rationality", [1e3, 1e6, 1e12, 1e100, 1e300])
@pytest.mark.parametrize("lapse_rate", [0.0, 0.1])
def test_extreme_rationality_neither_overflows_nor_underflows(rationality, lapse_rate):
    model = ResponseModel("sigmoid", rationality, lapse_rate)
    diffs = np.array([[1.0, 0.0, 0.0, 0.0]])
    weights = np.array([[1.0, 0.0, 0.0, 0.0]])
    right = model.log_likelihood(weights, ComparisonSet(diffs, np.array([1.0])))[0]
    wrong = model.log_likelihood(weights, ComparisonSet(diffs, np.array([-1.0])))[0]
    assert right == pytest.approx(math.log1p(-lapse_rate / 2), abs=1e-14)
    assert wrong == pytest.approx(-rationality if lapse_rate == 0.0 else math.log(lapse_rate / 2), rel=1e-13)


@pytest.mark.parametrize(
    "u", [-745.0, -701.0, -40.1, -39.9, -1e-12, 0.0, 1e-300, 36.8, 39.9, 40.1, 701.0, 745.0]
)
def test_the_sigmoid_is_exact_where_its_computation_changes_branch(u):
    model = ResponseModel("sigmoid", 1.0)
    comparisons = ComparisonSet(np.array([[u]]), np.array([1.0]))
    assert model.log_likelihood(np.ones((1, 1)), comparisons)[0] == pytest.approx(
        log_expit(u), rel=1e-12, abs=2e-15
    )


def test_a_hundred_wrong_answers_of_a_rational_person_add_up_exactly():
    comparisons = ComparisonSet(np.ones((100, 1)), -np.ones(100))
    assert ResponseModel("sigmoid", 500.0).log_likelihood(np.ones((1, 1)), comparisons)[0] == -50_000.0


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_without_answers_every_weight_is_as_likely(model):
    np.testing.assert_array_equal(model.log_likelihood(np.eye(4), ComparisonSet.empty(4)), np.zeros(4))


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(comparisons=answered(), weights=WEIGHTS)
def test_swapping_a_and_b_and_the_answer_changes_nothing(model, comparisons, weights):
    swapped = ComparisonSet(-comparisons.feature_diffs, -comparisons.signs)
    np.testing.assert_array_equal(
        model.log_likelihood(weights, comparisons), model.log_likelihood(weights, swapped)
    )


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(reward_diffs=arrays(np.float64, 5, elements=st.floats(-50.0, 50.0)))
def test_the_probabilities_of_a_and_of_b_sum_to_one(model, reward_diffs):
    total = model.probability_of_a(reward_diffs) + model.probability_of_a(-reward_diffs)
    np.testing.assert_allclose(total, 1.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize("model", [model for model in MODELS if model.name == "sigmoid"], ids=str)
@given(reward_diff=st.floats(-2.0, 2.0))
def test_the_log_likelihood_of_one_answer_is_the_log_of_its_probability(model, reward_diff):
    for choice in (Choice.A, Choice.B):
        comparisons = ComparisonSet(np.array([[reward_diff]]), np.array([choice.sign]))
        probability = model.probability_of_a(np.array(choice.sign * reward_diff))
        logarithm = model.log_likelihood(np.ones((1, 1)), comparisons)[0]
        assert math.exp(logarithm) == pytest.approx(float(probability), rel=1e-12)


def test_a_lapsing_person_is_never_surer_than_the_lapse_rate_allows():
    model = ResponseModel("sigmoid", 200.0, 0.1)
    np.testing.assert_allclose(
        model.probability_of_a(np.array([-1e9, 0.0, 1e9])), [0.05, 0.5, 0.95], rtol=0, atol=1e-15
    )


def test_the_rewarding_trajectory_is_the_likelier_choice():
    model = ResponseModel("sigmoid", 1.0)
    assert model.probability_of_a(np.array(math.log(3.0))) == pytest.approx(0.75, abs=1e-15)


@given(rationality=st.floats(0.1, 100.0), reward_diff=st.floats(-3.0, 3.0))
def test_the_clipped_model_normalised_over_both_answers_is_the_sigmoid(rationality, reward_diff):
    model = ResponseModel("clipped-linear", rationality)
    one = np.array([[reward_diff]])
    for_a, for_b = (
        math.exp(model.log_likelihood(np.ones((1, 1)), ComparisonSet(one, np.array([sign])))[0])
        for sign in (1.0, -1.0)
    )
    assert model.probability_of_a(np.array(reward_diff)) == pytest.approx(for_a / (for_a + for_b), rel=1e-12)


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(
    comparisons=answered(),
    weights=arrays(np.float64, 4, elements=st.floats(0.0, 1.0)),
    floor=st.floats(-500.0, 5.0),
)
def test_the_early_stop_never_changes_a_decision(model, comparisons, weights, floor):
    def value_with(lowest):
        packed, n_answers = choice_kernels.pack(comparisons.preferred_diffs)
        return choice_kernels.log_likelihood(
            model.kernel_kind, weights, packed, n_answers, model.rationality, model.lapse_rate, lowest
        )

    true, stopped = value_with(-math.inf), value_with(floor)
    # Partial sums and the padding's correction round differently within a few units in the last place.
    assume(abs(true - floor) > 1e-11 * max(1.0, abs(true)))
    if true < floor:
        assert stopped < floor
        assert stopped >= true - 1e-9 * abs(true)
    else:
        assert stopped == true


@pytest.mark.parametrize("n_answers", [0, 1, 15, 16, 17, 100])
def test_packing_pads_with_zeros_and_loses_nothing(n_answers):
    diffs = np.random.default_rng(n_answers).normal(size=(n_answers, 4))
    packed, counted = choice_kernels.pack(diffs)
    rows = packed.transpose(0, 2, 1).reshape(-1, 4)
    assert counted == n_answers
    np.testing.assert_array_equal(rows[:n_answers], diffs)
    assert not rows[n_answers:].any()
    assert len(rows) - n_answers < choice_kernels.BLOCK


ROWS = ResponseParameters(
    np.array([1.0, 20.0, 50.0, 200.0]), np.array([0.0, 0.1, 0.9, 0.1]), np.array([0.0, 0.0, 0.7, 2.5])
)
INFORMATIVE = (Choice.A, Choice.B, Choice.SAME)


@given(reward_diffs=arrays(np.float64, (4, 3), elements=st.floats(-20.0, 20.0)))
def test_each_row_of_parameters_has_its_own_probabilities_which_sum_to_one(reward_diffs):
    together = np.array([ROWS.probability_of(choice, reward_diffs) for choice in INFORMATIVE])
    np.testing.assert_allclose(together.sum(axis=0), 1.0, rtol=0, atol=1e-14)
    for row in range(4):
        alone = ROWS[row : row + 1]
        for number, choice in enumerate(INFORMATIVE):
            np.testing.assert_array_equal(
                together[number, row], alone.probability_of(choice, reward_diffs[row : row + 1])[0]
            )


@given(diff=st.floats(-2.0, 2.0), row=st.integers(0, 3))
def test_the_probabilities_are_those_of_rao_and_kupper(diff, row):
    """In the form of their paper: strengths pi, threshold theta, and lapses over two or three answers."""
    beta, lapse, eta = ROWS.rationality[row], ROWS.lapse_rate[row], ROWS.tie_threshold[row]
    ratio, theta = math.exp(beta * diff), math.exp(eta)
    prefers_a, prefers_b = ratio / (ratio + theta), 1 / (1 + theta * ratio)
    same = (theta**2 - 1) * ratio / ((ratio + theta) * (1 + theta * ratio))
    share = lapse / (3 if eta > 0 else 2)
    for choice, chosen in zip(INFORMATIVE, (prefers_a, prefers_b, same), strict=True):
        expected = (1 - lapse) * chosen + (share if choice is not Choice.SAME or eta > 0 else 0)
        found = ROWS[row : row + 1].probability_of(choice, np.array([diff]))[0]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_an_answer_that_says_nothing_has_no_probability():
    for choice in (Choice.UNSURE, Choice.SKIP):
        with pytest.raises(ValueError, match=f"got '{choice}'"):
            ROWS.probability_of(choice, np.zeros(4))
