"""Response models against the formulas written out with scipy, at every scale, and the early stop."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import log_expit
from scipy.stats import kstest, norm

from study_core import choice_kernels
from study_core.choice import PARAMETER_PRIORS, ResponseModel, ResponseParameters
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
# Up to two chunks of answers, with and without padding.
COUNTS = st.sampled_from([1, 2, 15, 16, 17, 32, 64, 65, 90])


@st.composite
def answered(draw, n_features=4):
    n = draw(COUNTS)
    diffs = draw(arrays(np.float64, (n, n_features), elements=st.floats(-2.0, 2.0)))
    signs = draw(arrays(np.float64, n, elements=st.sampled_from([-1.0, 1.0])))
    return ComparisonSet(diffs, signs)


def log_likelihood(model, weights, comparisons):
    return model.log_likelihood(weights, model.parameters(len(weights)), comparisons)


def probability_of_a(model, reward_diffs):
    return model.parameters(1).probability_of(Choice.A, reward_diffs[None])[0]


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
        log_likelihood(model, weights, comparisons),
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
    np.testing.assert_allclose(log_likelihood(model, weights, comparisons), terms.sum(axis=0), rtol=1e-12)


@pytest.mark.parametrize("rationality", [1e3, 1e6, 1e12, 1e100, 1e300])
@pytest.mark.parametrize("lapse_rate", [0.0, 0.1])
def test_extreme_rationality_neither_overflows_nor_underflows(rationality, lapse_rate):
    model = ResponseModel("sigmoid", rationality, lapse_rate)
    diffs = np.array([[1.0, 0.0, 0.0, 0.0]])
    weights = np.array([[1.0, 0.0, 0.0, 0.0]])
    right = log_likelihood(model, weights, ComparisonSet(diffs, np.array([1.0])))[0]
    wrong = log_likelihood(model, weights, ComparisonSet(diffs, np.array([-1.0])))[0]
    assert right == pytest.approx(math.log1p(-lapse_rate / 2), abs=1e-14)
    assert wrong == pytest.approx(-rationality if lapse_rate == 0.0 else math.log(lapse_rate / 2), rel=1e-13)


@pytest.mark.parametrize(
    "u", [-745.0, -701.0, -40.1, -39.9, -1e-12, 0.0, 1e-300, 36.8, 39.9, 40.1, 701.0, 745.0]
)
def test_the_sigmoid_is_exact_where_its_computation_changes_branch(u):
    model = ResponseModel("sigmoid", 1.0)
    comparisons = ComparisonSet(np.array([[u]]), np.array([1.0]))
    assert log_likelihood(model, np.ones((1, 1)), comparisons)[0] == pytest.approx(
        log_expit(u), rel=1e-12, abs=2e-15
    )


def test_a_hundred_wrong_answers_of_a_rational_person_add_up_exactly():
    comparisons = ComparisonSet(np.ones((100, 1)), -np.ones(100))
    assert log_likelihood(ResponseModel("sigmoid", 500.0), np.ones((1, 1)), comparisons)[0] == -50_000.0


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_without_answers_every_weight_is_as_likely(model):
    np.testing.assert_array_equal(log_likelihood(model, np.eye(4), ComparisonSet.empty(4)), np.zeros(4))


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(comparisons=answered(), weights=WEIGHTS)
def test_swapping_a_and_b_and_the_answer_changes_nothing(model, comparisons, weights):
    swapped = ComparisonSet(-comparisons.feature_diffs, -comparisons.signs)
    np.testing.assert_array_equal(
        log_likelihood(model, weights, comparisons), log_likelihood(model, weights, swapped)
    )


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(reward_diffs=arrays(np.float64, 5, elements=st.floats(-50.0, 50.0)))
def test_the_probabilities_of_a_and_of_b_sum_to_one(model, reward_diffs):
    total = probability_of_a(model, reward_diffs) + probability_of_a(model, -reward_diffs)
    np.testing.assert_allclose(total, 1.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize("model", [model for model in MODELS if model.name == "sigmoid"], ids=str)
@given(reward_diff=st.floats(-2.0, 2.0))
def test_the_log_likelihood_of_one_answer_is_the_log_of_its_probability(model, reward_diff):
    for choice in (Choice.A, Choice.B):
        comparisons = ComparisonSet(np.array([[reward_diff]]), np.array([choice.sign]))
        probability = probability_of_a(model, np.array(choice.sign * reward_diff))
        logarithm = log_likelihood(model, np.ones((1, 1)), comparisons)[0]
        assert math.exp(logarithm) == pytest.approx(float(probability), rel=1e-12)


def test_a_lapsing_person_is_never_surer_than_the_lapse_rate_allows():
    model = ResponseModel("sigmoid", 200.0, 0.1)
    np.testing.assert_allclose(
        probability_of_a(model, np.array([-1e9, 0.0, 1e9])), [0.05, 0.5, 0.95], rtol=0, atol=1e-15
    )


def test_the_rewarding_trajectory_is_the_likelier_choice():
    model = ResponseModel("sigmoid", 1.0)
    assert probability_of_a(model, np.array(math.log(3.0))) == pytest.approx(0.75, abs=1e-15)


@given(rationality=st.floats(0.1, 100.0), reward_diff=st.floats(-3.0, 3.0))
def test_the_clipped_model_normalised_over_both_answers_is_the_sigmoid(rationality, reward_diff):
    model = ResponseModel("clipped-linear", rationality)
    one = np.array([[reward_diff]])
    for_a, for_b = (
        math.exp(log_likelihood(model, np.ones((1, 1)), ComparisonSet(one, np.array([sign])))[0])
        for sign in (1.0, -1.0)
    )
    assert probability_of_a(model, np.array(reward_diff)) == pytest.approx(for_a / (for_a + for_b), rel=1e-12)


@pytest.mark.parametrize("model", MODELS, ids=str)
@given(
    comparisons=answered(),
    weights=arrays(np.float64, 4, elements=st.floats(0.0, 1.0)),
    floor=st.floats(-500.0, 5.0),
)
def test_the_early_stop_never_changes_a_decision(model, comparisons, weights, floor):
    def value_with(lowest):
        return choice_kernels.log_likelihood(
            model.kernel_kind,
            weights,
            model.rationality,
            model.lapse_rate,
            model.tie_threshold,
            choice_kernels.pack(comparisons.feature_diffs, comparisons.signs),
            lowest,
        )

    true, stopped = value_with(-math.inf), value_with(floor)
    # Partial sums and the padding's correction round differently within a few units in the last place.
    assume(abs(true - floor) > 1e-11 * max(1.0, abs(true)))
    if true < floor:
        assert stopped < floor
        assert stopped >= true - 1e-9 * abs(true)
    else:
        assert stopped == true


@pytest.mark.parametrize("n_decided", [0, 1, 15, 16, 17, 64, 65, 100])
@pytest.mark.parametrize("n_tied", [0, 3])
def test_packing_pads_with_zeros_and_loses_nothing(n_decided, n_tied):
    rng = np.random.default_rng(n_decided)
    diffs = rng.normal(size=(n_decided + n_tied, 4))
    signs = np.concatenate([rng.choice([-1.0, 1.0], n_decided), np.zeros(n_tied)])
    order = rng.permutation(len(signs))
    packed, counted, tied = choice_kernels.pack(diffs[order], signs[order])
    decided = order[order < n_decided]
    assert counted == n_decided
    np.testing.assert_array_equal(packed[:, :counted].T, (diffs * signs[:, None])[decided])
    assert not packed[:, counted:].any()
    assert packed.shape[1] % choice_kernels.BLOCK == 0
    assert packed.shape[1] - counted < choice_kernels.BLOCK
    np.testing.assert_array_equal(tied, diffs[order[order >= n_decided]])


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


@pytest.mark.parametrize("lapse_rate", [0.0, 1e-9, 1e-6, 1e-4, 0.05, 0.9])
@pytest.mark.parametrize("tie_threshold", [0.0, 0.3, 3.0])
@pytest.mark.parametrize("n", [1, 15, 16, 17, 48, 64, 65, 150])
def test_every_lapse_rate_and_threshold_is_exact_for_any_number_of_answers(lapse_rate, tie_threshold, n):
    """From sure agreement to sure disagreement: utilities up to +-400."""
    rng = np.random.default_rng(n)
    diffs = rng.normal(size=(n, 4)) * rng.choice([0.01, 1.0, 4.0], (n, 1))
    signs = rng.choice([-1.0, 1.0] if tie_threshold == 0.0 else [-1.0, 0.0, 1.0], n)
    weights = np.abs(rng.normal(size=(6, 4)))
    parameters = ResponseParameters.constant(6, 40.0, lapse_rate, tie_threshold)
    model = ResponseModel("sigmoid", 40.0, lapse_rate, tie_threshold)
    found = model.log_likelihood(weights, parameters, ComparisonSet(diffs, signs))
    expected = references.log_likelihoods(diffs, signs, weights, 40.0, lapse_rate, tie_threshold)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@given(
    reward_diff=st.floats(-3.0, 3.0),
    rationality=st.floats(0.1, 300.0),
    lapse_rate=st.sampled_from([0.0, 1e-3, 0.3]),
    tie_threshold=st.floats(1e-3, 20.0),
)
def test_the_log_likelihood_of_each_of_three_answers_is_the_log_of_its_probability(
    reward_diff, rationality, lapse_rate, tie_threshold
):
    model = ResponseModel("sigmoid", rationality, lapse_rate, tie_threshold)
    for choice in INFORMATIVE:
        comparisons = ComparisonSet(np.array([[reward_diff]]), np.array([choice.sign]))
        probability = model.parameters(1).probability_of(choice, np.array([reward_diff]))[0]
        assert math.exp(log_likelihood(model, np.ones((1, 1)), comparisons)[0]) == pytest.approx(
            probability, rel=1e-9, abs=1e-300
        )


def test_each_row_has_the_log_likelihood_of_its_own_parameters():
    rng = np.random.default_rng(3)
    comparisons = ComparisonSet(rng.normal(size=(20, 3)), rng.choice([-1.0, 0.0, 1.0], 20))
    weights = np.abs(rng.normal(size=(4, 3)))
    rows = ResponseParameters(ROWS.rationality, ROWS.lapse_rate, np.array([0.1, 0.4, 0.7, 2.5]))
    model = ResponseModel("sigmoid", "inferred", "inferred", "inferred")
    found = model.log_likelihood(weights, rows, comparisons)
    expected = references.log_likelihoods(
        comparisons.feature_diffs,
        comparisons.signs,
        weights,
        rows.rationality,
        rows.lapse_rate,
        rows.tie_threshold,
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_model_says_what_is_fixed_what_inferred_and_what_left_to_the_evidence():
    model = ResponseModel("sigmoid", "evidence", "inferred", 0.4)
    assert (model.inferred, model.chosen_by_evidence) == (("lapse_rate",), ("rationality",))
    fixed = model.with_fixed({"rationality": 20.0})
    assert fixed == ResponseModel("sigmoid", 20.0, "inferred", 0.4)
    rows = fixed.parameters(2, {"lapse_rate": np.array([0.1, 0.2])})
    assert (rows.rationality.tolist(), rows.lapse_rate.tolist()) == ([20.0, 20.0], [0.1, 0.2])
    assert rows.tie_threshold.tolist() == [0.4, 0.4]
    with pytest.raises(ValueError, match="Expected a number for lapse_rate, which is 'inferred'"):
        fixed.parameters(2)


@pytest.mark.statistical
def test_the_priors_of_the_parameters_are_the_documented_ones():
    drawn = ResponseModel("sigmoid", "inferred", "evidence", "inferred").draw_parameters(
        np.random.default_rng(1), 20_000
    )
    standardised = {
        "rationality": (np.log(drawn.rationality) - math.log(50.0)) / 1.5,
        "lapse_rate": np.log(drawn.lapse_rate / (1 - drawn.lapse_rate)) + 3.0,
        "tie_threshold": np.log(drawn.tie_threshold),
    }
    for name, values in standardised.items():
        assert kstest(values, "norm").pvalue > 1e-3, name
    for name, value in (("rationality", 80.0), ("lapse_rate", 0.02), ("tie_threshold", 0.5)):
        prior = PARAMETER_PRIORS[name]
        steps = [prior.log_density(value), prior.log_density(2 * value)]
        place = math.log(value / (1 - value)) if prior.transform == "logit" else math.log(value)
        other = math.log(2 * value / (1 - 2 * value)) if prior.transform == "logit" else math.log(2 * value)
        expected = norm(prior.location, prior.scale).logpdf([place, other])
        assert steps[1] - steps[0] == pytest.approx(expected[1] - expected[0], rel=1e-12)
