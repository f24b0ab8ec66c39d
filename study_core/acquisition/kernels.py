"""Compiled scores of pairs over all posterior samples, and their slopes in the pair's feature difference psi.

A sample is (w, beta, lapse rate, tie threshold). `utilities_per_feature` holds beta w, one column a sample, shape
`(n_features, n_samples)`: a pair's utilities u are one matrix product away. Probabilities of answers are those of
`study_core.choice.ResponseParameters`; a tie threshold above 0 means that "about the same" may be answered as well.
"""

import math

import numpy as np
from numba import njit

A, B, SAME = 0, 1, 2

# x / sqrt(1 + x^2) with this slope stays within 0.05 of tanh(u / 2), and vectorises.
_ALGEBRAIC_SLOPE = 0.58

# Beyond this an answer is as good as certain, and its logarithm is still finite.
_LARGEST_UTILITY = 300.0


@njit(cache=True, error_model="numpy")
def screen(features, pairs, utilities_per_feature, lapse_rates, tie_thresholds):
    """Returns a quick estimate of the information gain of each pair of rows of `features`, shape `(n_pairs,)`.

    To second order in how much the samples disagree, the gain is half the chi-square distance of their answers from
    the mean answer: no logarithms. An algebraic sigmoid takes the logistic one's place: no exponentials either.
    """
    scores = np.empty(len(pairs))
    n_answers = 3 if tie_thresholds[0] > 0.0 else 2
    psi = np.empty(features.shape[1])
    utilities = np.empty(utilities_per_feature.shape[1])
    answers = np.empty((n_answers, len(utilities)))
    for r in range(len(pairs)):
        for k in range(len(psi)):
            psi[k] = features[pairs[r, 0], k] - features[pairs[r, 1], k]
        _fill_utilities(psi, utilities_per_feature, utilities)
        _fill_answers_roughly(utilities, lapse_rates, tie_thresholds, answers)
        scores[r] = _half_chi_square(answers)
    return scores


@njit(cache=True, error_model="numpy")
def information_gains(psis, utilities_per_feature, lapse_rates, tie_thresholds):
    """Returns the information gain of each psi in nats `(n_pairs,)`, and its slope in psi `(n_pairs, n_features)`.

    I(answer; sample) = mean over samples of sum_a p_a log(p_a / m_a), where m is the samples' mean p. Its slope is
    the mean of sum_a p_a' log(p_a / m_a): all that comes from m cancels, because p and m each sum to 1.
    """
    n_pairs, n_features = psis.shape
    gains, slopes = np.zeros(n_pairs), np.zeros((n_pairs, n_features))
    n_answers = 3 if tie_thresholds[0] > 0.0 else 2
    utilities = np.empty(utilities_per_feature.shape[1])
    answers, changes = np.empty((2, n_answers, len(utilities)))
    for r in range(n_pairs):
        _fill_utilities(psis[r], utilities_per_feature, utilities)
        _fill_answers(utilities, lapse_rates, tie_thresholds, answers, changes)
        for a in range(n_answers):
            log_mean = math.log(answers[a].mean())
            for i in range(len(utilities)):
                surprise = math.log(answers[a, i]) - log_mean
                gains[r] += answers[a, i] * surprise
                for k in range(n_features):
                    slopes[r, k] += changes[a, i] * surprise * utilities_per_feature[k, i]
    return gains / len(utilities), slopes / len(utilities)


@njit(cache=True, error_model="numpy")
def removed_volumes(psis, utilities_per_feature):
    """Returns the share of volume that each answer removes, A and B, `(2, n_pairs)`, and its slopes in psi.

    An answer keeps of each sample min(1, e^u) or min(1, e^-u): all of one that would have given it. The slopes have
    shape `(2, n_pairs, n_features)`.
    """
    n_pairs, n_features = psis.shape
    volumes, slopes = np.zeros((2, n_pairs)), np.zeros((2, n_pairs, n_features))
    utilities = np.empty(utilities_per_feature.shape[1])
    for r in range(n_pairs):
        _fill_utilities(psis[r], utilities_per_feature, utilities)
        for i in range(len(utilities)):
            kept = math.exp(-abs(utilities[i]))
            answer, slope = (A, -kept) if utilities[i] < 0.0 else (B, kept)
            volumes[answer, r] += 1.0 - kept
            for k in range(n_features):
                slopes[answer, r, k] += slope * utilities_per_feature[k, i]
    return volumes / len(utilities), slopes / len(utilities)


@njit(cache=True, error_model="numpy")
def _fill_utilities(psi, utilities_per_feature, utilities):
    utilities[:] = 0.0
    for k in range(len(psi)):
        for i in range(len(utilities)):
            utilities[i] += psi[k] * utilities_per_feature[k, i]


@njit(cache=True, error_model="numpy")
def _fill_answers_roughly(utilities, lapse_rates, tie_thresholds, answers):
    """Fills the probability of each answer by the algebraic sigmoid, shape `(n_answers, n_samples)`."""
    n_answers = len(answers)
    for i in range(len(utilities)):
        x = _ALGEBRAIC_SLOPE * (utilities[i] - tie_thresholds[i])
        chosen = 0.5 + 0.5 * x / math.sqrt(1.0 + x * x)
        answers[A, i] = lapse_rates[i] / n_answers + (1.0 - lapse_rates[i]) * chosen
    for i in range(len(utilities)):
        x = _ALGEBRAIC_SLOPE * (-utilities[i] - tie_thresholds[i])
        chosen = 0.5 + 0.5 * x / math.sqrt(1.0 + x * x)
        answers[B, i] = lapse_rates[i] / n_answers + (1.0 - lapse_rates[i]) * chosen
    if n_answers == 3:
        for i in range(len(utilities)):
            answers[SAME, i] = 1.0 - answers[A, i] - answers[B, i]


@njit(cache=True, error_model="numpy")
def _half_chi_square(answers):
    """Returns half the mean of sum_a (p_a - m_a)^2 / m_a."""
    total = 0.0
    for a in range(len(answers)):
        first, second = 0.0, 0.0
        for i in range(answers.shape[1]):
            first += answers[a, i]
            second += answers[a, i] * answers[a, i]
        total += second / first
    return 0.5 * (total - 1.0)


@njit(cache=True, error_model="numpy")
def _fill_answers(utilities, lapse_rates, tie_thresholds, answers, changes):
    """Fills the probability of each answer and its slope in u, each of shape `(n_answers, n_samples)`."""
    n_answers = len(answers)
    for i in range(len(utilities)):
        u, threshold = min(max(utilities[i], -_LARGEST_UTILITY), _LARGEST_UTILITY), tie_thresholds[i]
        lapsed, kept = lapse_rates[i] / n_answers, 1.0 - lapse_rates[i]
        a, b = 1.0 / (1.0 + math.exp(threshold - u)), 1.0 / (1.0 + math.exp(threshold + u))
        answers[A, i], changes[A, i] = lapsed + kept * a, kept * a * (1.0 - a)
        answers[B, i], changes[B, i] = lapsed + kept * b, -kept * b * (1.0 - b)
        if n_answers == 3:
            answers[SAME, i] = lapsed + kept * a * b * math.expm1(2.0 * threshold)
            changes[SAME, i] = -changes[A, i] - changes[B, i]
