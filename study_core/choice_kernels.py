"""Compiled log-likelihoods of the response models: the inner loop of every posterior.

One call takes one weight vector and all answers. It works through chunks of answers, so that the compiler turns
every line into vector instructions, and takes logarithms of products instead of one an answer. It
stops early, with a value below `floor`, as soon as the likelihood can only end up there: each answer's term is at
most 0, so a sampler that would reject anyway need not finish the sum. The decision, and so the chain, is the same.
Answers of "about the same" are few and taken one by one.
"""

import math

import numpy as np
from numba import njit

SIGMOID = 0
CLIPPED_LINEAR = 1
# Answers are padded to whole blocks, and up to so many are worked on at once.
BLOCK = 16
CHUNK = 4 * BLOCK

# Without lapses, log(1 + e^u) = u to the last bit beyond the first; with them, e^-u is nothing beside the lapse rate
# beyond the second. Products of 16 terms of e^-40 and of 4 terms of e^170 are still numbers.
_LARGEST_EXPONENT = 40.0
_LARGEST_EXPONENT_WITH_LAPSES = 170.0
_SMALLEST_EXPONENT = -700.0

# Adding 1.5 * 2^52 to a double leaves its nearest integer in the low bits of the mantissa.
_ROUNDING_SHIFT = 6755399441055744.0
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10


def pack(feature_diffs: np.ndarray, signs: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
    """Returns answers as the kernels take them.

    Args:
        feature_diffs: psi of each answer, shape `(n_answers, n_features)`.
        signs: +1, -1, or 0 for "about the same", shape `(n_answers,)`.

    Returns:
        Phi(preferred) - Phi(other) of the decided answers, shape `(n_features, n_padded)`, padded with zeros to whole
        blocks; how many there are; and psi of the answers "about the same", shape `(n_tied, n_features)`.
    """
    is_decided = signs != 0.0
    preferred = (feature_diffs * signs[:, None])[is_decided]
    n_decided, n_features = preferred.shape
    padded = np.zeros((n_features, -(-n_decided // BLOCK) * BLOCK))
    padded[:, :n_decided] = preferred.T
    return padded, n_decided, np.ascontiguousarray(feature_diffs[~is_decided])


@njit(cache=True)
def log_likelihood(kind, weights, rationality, lapse_rate, tie_threshold, answers, floor):
    """Returns the log-likelihood of all answers under one weight vector, or anything below `floor` if it is below."""
    packed, n_decided, tied = answers
    lapsed = lapse_rate / (3.0 if tie_threshold > 0.0 else 2.0)
    total = 0.0
    if kind == SIGMOID:
        # A padding answer has equal rewards; what it adds is taken off beforehand.
        indifferent = lapsed + (1.0 - lapse_rate) / (1.0 + math.exp(tie_threshold))
        total -= (packed.shape[1] - n_decided) * math.log(indifferent)
    exponents, scratch = np.empty(CHUNK), np.empty(CHUNK)
    for start in range(0, packed.shape[1], CHUNK):
        n = min(CHUNK, packed.shape[1] - start)
        _disutilities(weights, packed[:, start : start + n], rationality, tie_threshold, exponents)
        if kind == SIGMOID:
            total += _sigmoid_chunk(exponents[:n], scratch[:n], lapse_rate, lapsed)
        else:
            total += _clipped_linear_chunk(exponents[:n])
        if total < floor:
            return total
    for t in range(tied.shape[0]):
        total += _log_same(weights, tied[t], rationality, lapse_rate, tie_threshold)
    return total


@njit(cache=True)
def log_likelihoods(kind, weights, rationality, lapse_rate, tie_threshold, answers):
    """Returns `log_likelihood` of each row of weights and parameters, in full."""
    values = np.empty(weights.shape[0])
    for i in range(weights.shape[0]):
        values[i] = log_likelihood(
            kind, weights[i], rationality[i], lapse_rate[i], tie_threshold[i], answers, -math.inf
        )
    return values


@njit(cache=True)
def _log_same(weights, feature_diff, rationality, lapse_rate, tie_threshold):
    """Returns log P(about the same).

    With c = e^-|u| and q = e^-eta, sinh(eta) / (cosh(eta) + cosh(u)) = (1 - q^2) c / ((c + q) (1 + c q)).
    """
    utility = 0.0
    for k in range(weights.shape[0]):
        utility += weights[k] * feature_diff[k]
    utility = abs(rationality * utility)
    log_sum = math.log1p(math.exp(-abs(utility - tie_threshold))) - min(utility, tie_threshold)
    log_same = (
        math.log(-math.expm1(-2.0 * tie_threshold))
        - utility
        - log_sum
        - math.log1p(math.exp(-utility - tie_threshold))
    )
    if lapse_rate == 0.0:
        return log_same
    return math.log(lapse_rate / 3.0 + (1.0 - lapse_rate) * math.exp(log_same))


@njit(cache=True)
def _disutilities(weights, chunk, rationality, tie_threshold, exponents):
    """Fills u = eta - beta w . (Phi(preferred) - Phi(other)) of one chunk."""
    n = chunk.shape[1]
    for i in range(n):
        exponents[i] = tie_threshold
    for k in range(weights.shape[0]):
        scaled = -rationality * weights[k]
        for i in range(n):
            exponents[i] += scaled * chunk[k, i]


@njit(cache=True)
def _sigmoid_chunk(exponents, scratch, lapse_rate, lapsed):
    """Returns the sum over a chunk of log(lapsed + (1 - lapse) / (1 + e^u)); overwrites both arrays."""
    n = exponents.shape[0]
    excess, largest = 0.0, _LARGEST_EXPONENT_WITH_LAPSES
    if lapse_rate == 0.0:
        largest = _LARGEST_EXPONENT
        for i in range(n):
            excess += max(exponents[i] - largest, 0.0)
    _exponentials(exponents, scratch, largest)
    for i in range(n):
        odds = 1.0 + exponents[i]
        exponents[i] = odds
        scratch[i] = lapsed * odds + (1.0 - lapse_rate)
    # Onto the first block: products of at most 4 answers, above and below; then of at most 16 probabilities.
    for start in range(BLOCK, n, BLOCK):
        for i in range(BLOCK):
            scratch[i] *= scratch[start + i]
            exponents[i] *= exponents[start + i]
    for i in range(BLOCK):
        scratch[i] /= exponents[i]
    total = -excess
    for i in range(BLOCK // 4):
        total += math.log((scratch[i] * scratch[i + 4]) * (scratch[i + 8] * scratch[i + 12]))
    return total


@njit(cache=True, fastmath={"contract"})
def _exponentials(exponents, scales, largest):
    """Replaces each u by e^min(u, largest), within 2e-16: e^u = 2^k e^r with |r| <= ln(2)/2, e^r by its series."""
    n = exponents.shape[0]
    bits = scales.view(np.int64)
    for i in range(n):
        u = min(max(exponents[i], _SMALLEST_EXPONENT), largest)
        scales[i] = u * _LOG2_E + _ROUNDING_SHIFT
        power = scales[i] - _ROUNDING_SHIFT
        exponents[i] = (u - power * _LN2_HIGH) - power * _LN2_LOW
    for i in range(n):
        bits[i] = (bits[i] + 1023) << 52
    for i in range(n):
        r = exponents[i]
        series = 1.0 / 479001600.0
        series = series * r + 1.0 / 39916800.0
        series = series * r + 1.0 / 3628800.0
        series = series * r + 1.0 / 362880.0
        series = series * r + 1.0 / 40320.0
        series = series * r + 1.0 / 5040.0
        series = series * r + 1.0 / 720.0
        series = series * r + 1.0 / 120.0
        series = series * r + 1.0 / 24.0
        series = series * r + 1.0 / 6.0
        series = series * r + 0.5
        exponents[i] = scales[i] * ((series * r + 1.0) * r + 1.0)


@njit(cache=True)
def _clipped_linear_chunk(exponents):
    """Returns the sum over a chunk of min(-u, 0), the published code's log-likelihood."""
    total = 0.0
    for i in range(exponents.shape[0]):
        total -= max(exponents[i], 0.0)
    return total
