"""Training of feature networks on one person's answers: all trials, whichever procedure.

The loss is the mean over the training pairs of

    -log P(answer),    P(A) = lapse / 2 + (1 - lapse) sigmoid(base + w_hc . psi + w_nn . learned)

which without lapses and base is the binary cross-entropy -z log P - (1 - z) log(1 - P); the paper prints its first
term with the wrong sign. Everything runs in compiled code that holds no lock, so threads share the work, and each
trial's numbers depend on its own stream alone: however many threads there are, the result is the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.errors import NetworkError, TooFewAnswersError
from study_core.networks import kernels
from study_core.networks.config import NetworkConfig
from study_core.networks.model import Examples, Networks, initial_networks

VERSION = "feature-network-1"

OnProgress = Callable[[float], None]
_State = tuple[np.ndarray, np.ndarray, np.ndarray]
_Trainer = Callable[[np.ndarray, np.ndarray, _State], np.ndarray]


@dataclass(frozen=True)
class Lesson:
    """What networks are trained on.

    Attributes:
        pairs: What was compared, in the order it was asked.
        signs: +1 where A was preferred, -1 where B was, shape `(n,)`.
        hand_coded_weights: What the linear weights of the hand-coded features start from, shape `(n_hand_coded,)`.
        lapse_rate: Share of answers given at random, in [0, 1).
    """

    pairs: Examples
    signs: Float[np.ndarray, " n"]
    hand_coded_weights: Float[np.ndarray, " n_hand_coded"]
    lapse_rate: float = 0.0

    def __len__(self) -> int:
        return len(self.signs)

    def __getitem__(self, rows: slice) -> Lesson:
        return Lesson(self.pairs[rows], self.signs[rows], self.hand_coded_weights, self.lapse_rate)


@dataclass(frozen=True)
class Trials:
    """What came of every trial, whether good or not.

    Attributes:
        networks: As they were at the end of each trial.
        losses: On the training pairs at the start of each epoch, shape `(n_trials, n_epochs)`.
        validation_losses: On the validation pairs, shape `(n_trials,)`; NaN without any.
        validation_accuracies: Share of the validation answers whose sign the log-odds have; NaN without any.
    """

    networks: Networks
    losses: Float[np.ndarray, "n_trials n_epochs"]
    validation_losses: Float[np.ndarray, " n_trials"]
    validation_accuracies: Float[np.ndarray, " n_trials"]


def train(
    rng: np.random.Generator,
    config: NetworkConfig,
    lesson: Lesson,
    n_threads: int = 1,
    on_progress: OnProgress = lambda share: None,
) -> Trials:
    """Trains every trial of a configuration on the first answers and scores each on the rest.

    Args:
        rng: Spawns a stream for each trial: of its linear weights and, where trials are independent, of its network.
        config: What is trained, and how.
        lesson: The answers.
        n_threads: Threads that share independent trials; the result doesn't depend on it.
        on_progress: Is told the share of the trials that are done, each time that one is.

    Raises:
        TooFewAnswersError: No answer is left to train on, or none to validate with.
        NetworkError: A trial ended in numbers that aren't finite.
    """
    n_training = round(config.training_share * len(lesson))
    if n_training < 1 or (n_training == len(lesson) and config.training_share < 1.0):
        raise TooFewAnswersError(
            f"Expected answers to train on and to validate with, got {len(lesson)}. Ask for more of them."
        )
    starts = initial_networks(
        rng.spawn(config.n_trials),
        lesson.pairs.inputs_a.shape[2],
        config.n_hidden,
        config.n_features,
        lesson.hand_coded_weights,
    )
    packed, linear_weights = starts.packed, starts.linear_weights.copy()
    run = _continued if config.procedure == "continued" else _independent
    losses = []
    for curve in run(
        _trainer(config, starts.kernel_shape, lesson[:n_training]), packed, linear_weights, n_threads
    ):
        losses.append(curve)
        on_progress(len(losses) / config.n_trials)
    networks = starts.unpacked(packed, linear_weights)
    _check_finite(packed, linear_weights)
    return Trials(networks, np.stack(losses), *_validate(networks, lesson[n_training:]))


def _trainer(config: NetworkConfig, shape: tuple[int, int, int], lesson: Lesson) -> _Trainer:
    """Returns what takes one network through the epochs of a trial, in place, and returns their losses."""
    pairs = lesson.pairs
    examples = (
        pairs.packed_inputs,
        pairs.inputs_a.shape[1],
        np.ascontiguousarray(pairs.hand_coded_diffs),
        lesson.signs,
        pairs.base_logits,
        lesson.lapse_rate,
    )
    optimiser = (config.learning_rate, *config.betas, config.weight_decay)
    linear_steps = (config.epochs_per_linear_update, config.n_linear_steps, config.linear_rate)

    def run_trial(parameters: np.ndarray, linear_weights: np.ndarray, state: _State) -> np.ndarray:
        network = (parameters, linear_weights)
        curve: np.ndarray = kernels.train(
            shape, examples, optimiser, linear_steps, config.n_epochs, network, state
        )
        return curve

    return run_trial


def _independent(
    run_trial: _Trainer, packed: np.ndarray, linear_weights: np.ndarray, n_threads: int
) -> Iterator[np.ndarray]:
    with ThreadPoolExecutor(n_threads) as pool:
        states = [_new_state(packed) for _ in packed]
        yield from pool.map(run_trial, packed, linear_weights, states)


def _continued(
    run_trial: _Trainer, packed: np.ndarray, linear_weights: np.ndarray, n_threads: int
) -> Iterator[np.ndarray]:
    """Runs one trial after the other on the network of the last, whatever the number of threads."""
    state = _new_state(packed)
    for trial in range(len(packed)):
        packed[trial] = packed[max(trial - 1, 0)]
        yield run_trial(packed[trial], linear_weights[trial], state)


def _new_state(packed: np.ndarray) -> _State:
    return np.zeros_like(packed[0]), np.zeros_like(packed[0]), np.array([0.0, 1.0])


def _check_finite(*arrays: np.ndarray) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise NetworkError(
            "Expected training to stay finite, but it diverged. Lower the learning rates, or look for inputs that "
            "aren't finite."
        )


def _validate(
    networks: Networks, lesson: Lesson
) -> tuple[Float[np.ndarray, " n_trials"], Float[np.ndarray, " n_trials"]]:
    """Returns each network's mean loss and share of predicted signs; a tie counts half."""
    if len(lesson) == 0:
        return np.full(len(networks), np.nan), np.full(len(networks), np.nan)
    logits = networks.logits(lesson.pairs)
    losses = [kernels.losses_of(row, lesson.signs, lesson.lapse_rate).mean() for row in logits]
    return np.array(losses), (0.5 + 0.5 * np.sign(logits * lesson.signs)).mean(axis=1)
