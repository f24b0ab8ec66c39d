"""Compiled log-likelihoods of the response models: the inner loop of every posterior.

One call takes one weight vector and all answers. It works through blocks of answers, so that the compiler turns
every line into vector instructions, and takes one logarithm of a block's product instead of one an answer. It
stops early, with a value below `floor`, as soon as the likelihood can only end up there: each answer's term is at
most 0, so a sampler that would reject anyway need not finish the sum. The decision, and so the chain, is the same.
"""

import math

import numpy as np
from numba import njit

SIGMOID = 0
CLIPPED_LINEAR = 1
BLOCK = 16

# Beyond this, log(1 + e^u) = u to the last bit; a block's product of such terms stays finite.
_LARGEST_EXPONENT = 40.0
_SMALLEST_EXPONENT = -700.0

# Adding 1.5 * 2^52 to a double leaves its nearest integer in the low bits of the mantissa.
_ROUNDING_SHIFT = 6755399441055744.0
_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10


def pack(preferred_diffs: np.ndarray) -> tuple[np.ndarray, int]:
    """Returns the differences as `(n_blocks, n_features, BLOCK)`, padded with zeros, and the number of answers."""
    n_answers, n_features = preferred_diffs.shape
    n_blocks = -(-n_answers // BLOCK)
    padded = np.zeros((n_blocks * BLOCK, n_features))
    padded[:n_answers] = preferred_diffs
    return np.ascontiguousarray(padded.reshape(n_blocks, BLOCK, n_features).transpose(0, 2, 1)), n_answers


@njit(cache=True)
def log_likelihood(kind, weights, packed, n_answers, rationality, lapse_rate, floor):
    """Returns the log-likelihood of all answers under one weight vector, or anything below `floor` if it is below."""
    # A padding answer has equal rewards: log(1/2) in the sigmoid, 0 in the clipped model.
    total = (packed.shape[0] * BLOCK - n_answers) * math.log(2.0) if kind == SIGMOID else 0.0
    exponents, scales = np.empty(BLOCK), np.empty(BLOCK)
    for b in range(packed.shape[0]):
        _disutilities(weights, packed[b], rationality, exponents)
        if kind == SIGMOID:
            total += _sigmoid_block(exponents, scales, lapse_rate)
        else:
            total += _clipped_linear_block(exponents)
        if total < floor:
            break
    return total


@njit(cache=True)
def log_likelihoods(kind, weights, packed, n_answers, rationality, lapse_rate):
    """Returns `log_likelihood` of each row of `weights`, in full."""
    values = np.empty(weights.shape[0])
    for i in range(weights.shape[0]):
        values[i] = log_likelihood(kind, weights[i], packed, n_answers, rationality, lapse_rate, -math.inf)
    return values


@njit(cache=True)
def _disutilities(weights, block, rationality, exponents):
    """Fills u = -beta w . (Phi(preferred) - Phi(other)) of one block."""
    for i in range(BLOCK):
        exponents[i] = 0.0
    for k in range(weights.shape[0]):
        scaled = -rationality * weights[k]
        for i in range(BLOCK):
            exponents[i] += scaled * block[k, i]


@njit(cache=True)
def _sigmoid_block(exponents, scratch, lapse_rate):
    """Returns the sum over a block of log(lapse/2 + (1 - lapse) / (1 + e^u)); overwrites both arrays."""
    excess = 0.0
    if lapse_rate == 0.0:
        for i in range(BLOCK):
            excess += max(exponents[i] - _LARGEST_EXPONENT, 0.0)
    _exponentials(exponents, scratch)
    for i in range(BLOCK):
        odds = 1.0 + exponents[i]
        exponents[i] = odds
        scratch[i] = 0.5 * lapse_rate * odds + (1.0 - lapse_rate)
    return math.log(_product(scratch) / _product(exponents)) - excess


@njit(cache=True)
def _product(values):
    """Returns the product of a block by halving, which vectorises and has one fixed order; overwrites the block."""
    half = BLOCK // 2
    while half > 0:
        for i in range(half):
            values[i] *= values[half + i]
        half //= 2
    return values[0]


@njit(cache=True, fastmath={"contract"})
def _exponentials(exponents, scales):
    """Replaces each u by e^min(u, 40), within 2e-16 relative: e^u = 2^k e^r with |r| <= ln(2)/2, e^r by its series."""
    bits = scales.view(np.int64)
    for i in range(BLOCK):
        u = min(max(exponents[i], _SMALLEST_EXPONENT), _LARGEST_EXPONENT)
        scales[i] = u * _LOG2_E + _ROUNDING_SHIFT
        power = scales[i] - _ROUNDING_SHIFT
        exponents[i] = (u - power * _LN2_HIGH) - power * _LN2_LOW
    for i in range(BLOCK):
        bits[i] = (bits[i] + 1023) << 52
    for i in range(BLOCK):
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
def _clipped_linear_block(exponents):
    """Returns the sum over a block of min(-u, 0), the published code's log-likelihood."""
    total = 0.0
    for i in range(BLOCK):
        total -= max(exponents[i], 0.0)
    return total
