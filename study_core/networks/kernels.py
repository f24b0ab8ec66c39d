"""Compiled training of feature networks: forward pass, backward pass and optimiser in one sweep without temporaries.

The steps of both trajectories of some pairs lie beside each other, `(n_inputs, n_samples)`, so that every inner loop
runs over them and the compiler turns it into vector instructions; what a chunk of pairs needs stays in the nearest
cache. The hidden layer isn't stored: to compute an activation again costs less than to fetch it. Inputs are padded
with zeros to whole groups of four; the first group shares its pass with everything else.

A network's parameters are one vector: hidden weights, hidden biases, output weights, output biases. Reductions may
be reordered by the compiler, the same way at every run.
"""

import math

import numpy as np
from numba import njit

INPUTS_AT_ONCE = 4
_SAMPLES_AT_ONCE = 1200
_REORDER = {"reassoc", "contract", "nsz"}
_ZERO = np.float32(0.0)

# NADAM as in Dozat (2016): its schedule of the momentum, and what keeps a step finite.
_MOMENTUM_DECAY, _MOMENTUM_SCALE = 0.96, 0.004
_EPSILON = 1e-8
_LARGEST_EXPONENT = 700.0


@njit(cache=True, nogil=True)
def train(shape, examples, optimiser, linear_steps, n_epochs, network, state):
    """Trains one network in place and returns the loss at the start of each epoch, `(n_epochs,)`.

    Args:
        shape: (n_padded_inputs, n_hidden, n_features).
        examples: (inputs `(n_padded_inputs, n * 2 * n_steps)`, n_steps, hand-coded differences `(n, n_hand_coded)`,
            signs `(n,)`, base logits `(n,)`, lapse rate).
        optimiser: (learning rate, beta 1, beta 2, weight decay).
        linear_steps: (epochs between updates of the linear weights, gradient steps of one, their rate).
        n_epochs: Updates of the parameters.
        network: (parameters, linear weights), changed in place.
        state: (first moments, second moments, (number of steps, product of momenta)), changed in place.
    """
    parameters, linear = network
    every, n_linear, linear_rate = linear_steps
    losses = np.empty(n_epochs)
    gradient = np.empty_like(parameters)
    for epoch in range(n_epochs):
        losses[epoch] = loss_and_gradient(shape, examples, network, gradient)
        _nadam(optimiser, parameters, gradient, state)
        if (epoch + 1) % every == 0:
            diffs = feature_diffs(shape, examples[0], examples[1], parameters)
            for _ in range(n_linear):
                _linear_step(examples, diffs, linear_rate, linear)
    return losses


@njit(cache=True, nogil=True)
def feature_diffs(shape, inputs, n_steps, parameters):
    """Returns the learned features of A less those of B, each summed over its steps, `(n, n_features)`."""
    n = inputs.shape[1] // (2 * n_steps)
    n_chunk = max(1, _SAMPLES_AT_ONCE // (2 * n_steps))
    outputs = np.empty((shape[2], min(n_chunk, n) * 2 * n_steps), dtype=np.float32)
    diffs = np.empty((n, shape[2]))
    for first in range(0, n, n_chunk):
        last = min(first + n_chunk, n)
        samples = (first * 2 * n_steps, last * 2 * n_steps)
        _forward(shape, inputs, samples, parameters, outputs)
        _sum_pairs(outputs, n_steps, diffs[first:last])
    return diffs


@njit(cache=True, nogil=True)
def loss_and_gradient(shape, examples, network, gradient):
    """Returns the mean of -log P(answer); fills its gradient in the parameters."""
    inputs, n_steps, hand_coded, signs, base_logits, lapse_rate = examples
    parameters, linear = network
    n, n_hand_coded = hand_coded.shape
    n_chunk = max(1, _SAMPLES_AT_ONCE // (2 * n_steps))
    outputs = np.empty((shape[2], min(n_chunk, n) * 2 * n_steps), dtype=np.float32)
    diffs = np.empty((n, shape[2]))
    gradient[:] = _ZERO
    total = 0.0
    for first in range(0, n, n_chunk):
        last = min(first + n_chunk, n)
        samples = (first * 2 * n_steps, last * 2 * n_steps)
        _forward(shape, inputs, samples, parameters, outputs)
        _sum_pairs(outputs, n_steps, diffs[first:last])
        for i in range(first, last):
            logit = _logit(base_logits[i], hand_coded[i], diffs[i], linear)
            loss, slope = _loss_and_slope(signs[i] * logit, lapse_rate)
            total += loss
            _to_slopes(
                outputs, (i - first) * 2 * n_steps, n_steps, signs[i] * slope / n, linear[n_hand_coded:]
            )
        _backward(shape, inputs, samples, parameters, outputs, gradient)
    return total / n


@njit(cache=True, nogil=True)
def losses_of(logits, signs, lapse_rate):
    """Returns -log P(answer) of each answer, `(n,)`."""
    losses = np.empty(len(logits))
    for i in range(len(logits)):
        losses[i], _ = _loss_and_slope(signs[i] * logits[i], lapse_rate)
    return losses


@njit(cache=True, nogil=True)
def _logit(base_logit, hand_coded, diffs, linear):
    logit = base_logit
    for k in range(len(hand_coded)):
        logit += linear[k] * hand_coded[k]
    for f in range(len(diffs)):
        logit += linear[len(hand_coded) + f] * diffs[f]
    return logit


@njit(cache=True, nogil=True)
def _loss_and_slope(margin, lapse_rate):
    """Returns -log(lapse / 2 + (1 - lapse) sigmoid(margin)) and its derivative; nothing in it can overflow."""
    odds_against = math.exp(min(-margin, _LARGEST_EXPONENT))
    wrong = odds_against / (1.0 + odds_against)
    if lapse_rate == 0.0:
        return max(-margin, 0.0) + math.log1p(math.exp(-abs(margin))), -wrong
    likely = 0.5 * lapse_rate + (1.0 - lapse_rate) / (1.0 + odds_against)
    return -math.log(likely), -wrong * (1.0 - lapse_rate) / ((1.0 + odds_against) * likely)


@njit(cache=True, nogil=True)
def _linear_step(examples, diffs, rate, linear):
    """Takes one step down the loss's full-batch gradient in the linear weights."""
    _, _, hand_coded, signs, base_logits, lapse_rate = examples
    n, n_hand_coded = hand_coded.shape
    gradient = np.zeros(len(linear))
    for i in range(n):
        logit = _logit(base_logits[i], hand_coded[i], diffs[i], linear)
        _, slope = _loss_and_slope(signs[i] * logit, lapse_rate)
        slope *= signs[i] / n
        for k in range(n_hand_coded):
            gradient[k] += slope * hand_coded[i, k]
        for f in range(diffs.shape[1]):
            gradient[n_hand_coded + f] += slope * diffs[i, f]
    for k in range(len(linear)):
        linear[k] -= rate * gradient[k]


@njit(cache=True, nogil=True)
def _nadam(optimiser, parameters, gradient, state):
    """Takes one step of NADAM (Dozat 2016), weight decay added to the gradient."""
    rate, beta_1, beta_2, weight_decay = optimiser
    first, second, counters = state
    counters[0] += 1.0
    step = counters[0]
    momentum = beta_1 * (1.0 - 0.5 * _MOMENTUM_DECAY ** (step * _MOMENTUM_SCALE))
    next_momentum = beta_1 * (1.0 - 0.5 * _MOMENTUM_DECAY ** ((step + 1.0) * _MOMENTUM_SCALE))
    counters[1] *= momentum
    of_gradient = rate * (1.0 - momentum) / (1.0 - counters[1])
    of_moment = rate * next_momentum / (1.0 - counters[1] * next_momentum)
    correction = 1.0 - beta_2**step
    for i in range(len(parameters)):
        slope = gradient[i] + weight_decay * parameters[i]
        first[i] = beta_1 * first[i] + (1.0 - beta_1) * slope
        second[i] = beta_2 * second[i] + (1.0 - beta_2) * slope * slope
        size = math.sqrt(second[i] / correction) + _EPSILON
        parameters[i] -= (of_gradient * slope + of_moment * first[i]) / size


@njit(cache=True, nogil=True)
def _views(shape, flat):
    """Returns hidden weights, hidden biases, output weights and output biases as views of one vector."""
    n_inputs, n_hidden, n_features = shape
    a = n_hidden * n_inputs
    b = a + n_hidden
    c = b + n_features * n_hidden
    return (
        flat[:a].reshape(n_hidden, n_inputs),
        flat[a:b],
        flat[b:c].reshape(n_features, n_hidden),
        flat[c : c + n_features],
    )


@njit(cache=True, nogil=True)
def _four_rows(inputs, k, samples):
    """Returns some samples of four inputs, each a contiguous view."""
    first, last = samples
    return (
        inputs[k][first:last],
        inputs[k + 1][first:last],
        inputs[k + 2][first:last],
        inputs[k + 3][first:last],
    )


@njit(cache=True, nogil=True, fastmath=_REORDER)
def _add_further_inputs(inputs, samples, weights, further):
    """Fills what the inputs after the first four add to one hidden unit; where there are none, it stays 0."""
    if inputs.shape[0] > INPUTS_AT_ONCE:
        further[:] = _ZERO
    for k in range(INPUTS_AT_ONCE, inputs.shape[0], INPUTS_AT_ONCE):
        x0, x1, x2, x3 = _four_rows(inputs, k, samples)
        w0, w1, w2, w3 = weights[k], weights[k + 1], weights[k + 2], weights[k + 3]
        for s in range(len(further)):
            further[s] += w0 * x0[s] + w1 * x1[s] + w2 * x2[s] + w3 * x3[s]


@njit(cache=True, nogil=True, fastmath=_REORDER)
def _forward(shape, inputs, samples, parameters, outputs):
    """Fills the outputs of each sample, `(n_features, n_samples)`."""
    hidden, hidden_biases, output, output_biases = _views(shape, parameters)
    n = samples[1] - samples[0]
    further = np.zeros(n, dtype=np.float32)
    x0, x1, x2, x3 = _four_rows(inputs, 0, samples)
    for f in range(shape[2]):
        outputs[f][:n] = output_biases[f]
    for j in range(shape[1]):
        _add_further_inputs(inputs, samples, hidden[j], further)
        w0, w1, w2, w3, bias = hidden[j, 0], hidden[j, 1], hidden[j, 2], hidden[j, 3], hidden_biases[j]
        for f in range(shape[2]):
            weight, row = output[f, j], outputs[f]
            for s in range(n):
                activation = bias + further[s] + w0 * x0[s] + w1 * x1[s] + w2 * x2[s] + w3 * x3[s]
                row[s] += weight * max(activation, _ZERO)
    for f in range(shape[2]):
        _tanh(outputs[f][:n])


@njit(cache=True, nogil=True)
def _tanh(values):
    """Replaces each value by its tanh, (1 - q) / (1 + q) with q = e^(-2 |x|), without a call that can't be vectorised.

    The exponential is its series at a 64th, squared six times: good to 1e-9, a hundredth of a float32's precision.
    """
    for s in range(len(values)):
        x = np.float64(values[s])
        y = -2.0 * min(abs(x), 10.0) / 64.0
        q = 1.0 + y * (1.0 + y / 2.0 * (1.0 + y / 3.0 * (1.0 + y / 4.0 * (1.0 + y / 5.0 * (1.0 + y / 6.0)))))
        q *= q
        q *= q
        q *= q
        q *= q
        q *= q
        q *= q
        size = (1.0 - q) / (1.0 + q)
        values[s] = size if x > 0.0 else -size


@njit(cache=True, nogil=True)
def _sum_pairs(outputs, n_steps, diffs):
    """Fills the sums over A's steps less the sums over B's."""
    for i in range(diffs.shape[0]):
        for f in range(diffs.shape[1]):
            start = i * 2 * n_steps
            total = 0.0
            for s in range(start, start + n_steps):
                total += outputs[f, s] - outputs[f, s + n_steps]
            diffs[i, f] = total


@njit(cache=True, nogil=True)
def _to_slopes(outputs, start, n_steps, slope, weights):
    """Replaces the outputs of one pair by the loss's slope before their tanh."""
    for f in range(outputs.shape[0]):
        of_a = np.float32(slope * weights[f])
        for s in range(start, start + n_steps):
            outputs[f, s] = of_a * (np.float32(1.0) - outputs[f, s] * outputs[f, s])
        for s in range(start + n_steps, start + 2 * n_steps):
            outputs[f, s] = -of_a * (np.float32(1.0) - outputs[f, s] * outputs[f, s])


@njit(cache=True, nogil=True, fastmath=_REORDER)
def _backward(shape, inputs, samples, parameters, slopes, gradient):
    """Adds to the gradient what the slopes before the tanh of each sample make of it."""
    hidden, hidden_biases, output, _ = _views(shape, parameters)
    to_hidden, to_hidden_biases, to_output, to_output_biases = _views(shape, gradient)
    n = samples[1] - samples[0]
    further = np.zeros(n, dtype=np.float32)
    passed = np.empty(n, dtype=np.float32)
    x0, x1, x2, x3 = _four_rows(inputs, 0, samples)
    for j in range(shape[1]):
        _add_further_inputs(inputs, samples, hidden[j], further)
        w0, w1, w2, w3, bias = hidden[j, 0], hidden[j, 1], hidden[j, 2], hidden[j, 3], hidden_biases[j]
        for f in range(shape[2]):
            weight, row = output[f, j], slopes[f]
            g0, g1, g2, g3, to_bias, to_weight = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
            for s in range(n):
                activation = bias + further[s] + w0 * x0[s] + w1 * x1[s] + w2 * x2[s] + w3 * x3[s]
                slope = row[s] if activation > _ZERO else _ZERO
                passed[s] = slope
                g0 += slope * x0[s]
                g1 += slope * x1[s]
                g2 += slope * x2[s]
                g3 += slope * x3[s]
                to_bias += slope
                to_weight += slope * activation
            to_output[f, j] += to_weight
            to_hidden_biases[j] += weight * to_bias
            to_hidden[j, 0] += weight * g0
            to_hidden[j, 1] += weight * g1
            to_hidden[j, 2] += weight * g2
            to_hidden[j, 3] += weight * g3
            _add_to_further_inputs(inputs, samples, weight, passed, to_hidden[j])
    for f in range(shape[2]):
        to_output_biases[f] += slopes[f][:n].sum()


@njit(cache=True, nogil=True, fastmath=_REORDER)
def _add_to_further_inputs(inputs, samples, weight, passed, gradient):
    """Adds what passes a hidden unit to the gradient of the weights of the inputs after its first four."""
    for k in range(INPUTS_AT_ONCE, inputs.shape[0], INPUTS_AT_ONCE):
        x0, x1, x2, x3 = _four_rows(inputs, k, samples)
        g0, g1, g2, g3 = _ZERO, _ZERO, _ZERO, _ZERO
        for s in range(len(passed)):
            g0 += passed[s] * x0[s]
            g1 += passed[s] * x1[s]
            g2 += passed[s] * x2[s]
            g3 += passed[s] * x3[s]
        gradient[k] += weight * g0
        gradient[k + 1] += weight * g1
        gradient[k + 2] += weight * g2
        gradient[k + 3] += weight * g3
