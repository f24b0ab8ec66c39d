"""One feature network that all people share, and a linear head for each of them.

    features = mean over steps of tanh(layer 3(tanh(layer 2(tanh(layer 1(inputs))))))

The network learns from everyone's answers with heads of its own, by their penalised log likelihood. Then its features
take the place of hand-made ones in the hierarchical model (`study_core.predictors.hierarchy`), which learns everybody's
head again, with its uncertainty; somebody new gets a head and leaves the network as it is.

Sizes, penalties and the number of epochs were chosen by cross-validation on training answers (see DECISIONS.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float

from study_core.domain import Domain
from study_core.predictors.linear_people import LinearPeople, inverse_scales, learn_people, states_compared
from study_core.predictors.predictor import Training
from study_core.streams import stream

_HIDDEN = 32
_FEATURES = 8
_EPOCHS = 240
_LEARNING_RATE = 0.003
_MATRIX_PRECISION = 10.0
# The features of two drives differ by about a tenth. In this unit heads are of size 1 and learn as fast as the rest.
_HEAD_UNIT = 10.0
_SHARED_HEAD_SCALE = 0.5
_PERSONAL_HEAD_SCALE = 0.3
# So that one wild answer pulls at nothing.
_LAPSE_RATE = 0.02
# Neighbouring steps are alike: this many, evenly spread, say as much as all and cost a fifth.
_MOST_STEPS = 10

_Array = TypeVar("_Array", np.ndarray, torch.Tensor)
_Layers = Sequence[tuple[_Array, _Array]]


@dataclass(frozen=True)
class NetworkFeatures:
    """Learned features of trajectories.

    Attributes:
        domain: Gives the inputs: states, network inputs and time.
        means: Of each input, shape `(n_inputs,)`.
        inverse_scales: 1 over each input's standard deviation, 0 for a constant one, shape `(n_inputs,)`.
        layers: Matrix and bias of each layer.
    """

    domain: Domain
    means: Float[np.ndarray, " n_inputs"]
    inverse_scales: Float[np.ndarray, " n_inputs"]
    layers: tuple[tuple[Float[np.ndarray, "_ _"], Float[np.ndarray, "_"]], ...]

    def __call__(self, states: Float[np.ndarray, "n n_steps n_states"]) -> Float[np.ndarray, "n k"]:
        """Returns the features of each trajectory, within (-1, 1)."""
        inputs = (_inputs(self.domain, states) - self.means) * self.inverse_scales
        return _mean_features(inputs, self.layers, np.tanh)


class SharedNetwork:
    """A `Predictor`.

    Attributes:
        name: `shared-network`.
    """

    name = "shared-network"

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> LinearPeople:
        """Trains the network on everyone's active answers and learns everybody's head.

        Args:
            seed: Names the stream of the network's first weights.
            domain: Gives states and network inputs.
            people: Active answers by person; somebody may have given none.

        Raises:
            TooFewAnswersError: Nobody has given an answer.
        """
        trainings = [people[name] for name in sorted(people)]
        inputs = _inputs(domain, states_compared(trainings))
        means, scales = inputs.mean(axis=(0, 1)), inverse_scales(inputs.reshape(-1, inputs.shape[-1]))
        layers = _train(stream(seed, self.name), (inputs - means) * scales, trainings)
        return learn_people(NetworkFeatures(domain, means, scales, layers), people)


def _inputs(
    domain: Domain, states: Float[np.ndarray, "n n_steps n_states"]
) -> Float[np.ndarray, "n n_shown n_inputs"]:
    """Returns states, network inputs and time, the latter within [-1, 1]: what else moves depends on it."""
    n, n_steps, _ = states.shape
    every = -(-n_steps // _MOST_STEPS)
    time = np.broadcast_to(np.linspace(-1.0, 1.0, n_steps)[:, None], (n, n_steps, 1))
    return np.concatenate([states, domain.network_inputs(states), time], axis=2)[:, every // 2 :: every]


def _mean_features(inputs: _Array, layers: _Layers[_Array], tanh: Callable[[_Array], _Array]) -> _Array:
    for matrix, bias in layers:
        inputs = tanh(inputs @ matrix + bias)
    return inputs.mean(-2)


@dataclass(frozen=True)
class _Parameters:
    """What is trained: the network, and heads for it in units of `_HEAD_UNIT`."""

    layers: tuple[tuple[torch.Tensor, torch.Tensor], ...]
    shared_head: torch.Tensor
    deviations: torch.Tensor

    def __iter__(self) -> Iterator[torch.Tensor]:
        for layer in self.layers:
            yield from layer
        yield self.shared_head
        yield self.deviations


def _train(
    rng: np.random.Generator,
    inputs: Float[np.ndarray, "n_trajectories n_shown n_inputs"],
    trainings: Sequence[Training],
) -> tuple[tuple[Float[np.ndarray, "_ _"], Float[np.ndarray, "_"]], ...]:
    """Returns the layers after training on all answers at once, in single precision and on one thread.

    Args:
        rng: Draws the first weights.
        inputs: Standardised, of all A in the order of people and answers, then of all B.
        trainings: The same people's answers.
    """
    torch.set_num_threads(1)
    seen = torch.tensor(inputs, dtype=torch.float32)
    signs = torch.tensor(np.concatenate([training.signs for training in trainings]), dtype=torch.float32)
    who = torch.tensor(np.repeat(np.arange(len(trainings)), [len(training) for training in trainings]))
    parameters = _first_parameters(rng, inputs.shape[-1], len(trainings))
    optimiser = torch.optim.NAdam(parameters, lr=_LEARNING_RATE)
    for _ in range(_EPOCHS):
        optimiser.zero_grad()
        _loss(parameters, seen, signs, who).backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    return tuple((_array(matrix), _array(bias)) for matrix, bias in parameters.layers)


def _first_parameters(rng: np.random.Generator, n_inputs: int, n_people: int) -> _Parameters:
    sizes = (n_inputs, _HIDDEN, _HIDDEN, _FEATURES)
    layers = tuple(
        (_parameter(rng.normal(0.0, n_in**-0.5, (n_in, n_out))), _parameter(np.zeros(n_out)))
        for n_in, n_out in pairwise(sizes)
    )
    shared_head = _parameter(rng.normal(0.0, _SHARED_HEAD_SCALE, _FEATURES))
    return _Parameters(layers, shared_head, _parameter(np.zeros((n_people, _FEATURES))))


def _loss(
    parameters: _Parameters, seen: torch.Tensor, signs: torch.Tensor, who: torch.Tensor
) -> torch.Tensor:
    """Returns -log posterior: of all answers, and of normal priors on matrices and heads."""
    features_a, features_b = _mean_features(seen, parameters.layers, torch.tanh).chunk(2)
    heads = _HEAD_UNIT * (parameters.shared_head + parameters.deviations[who])
    utility_diffs = signs * ((features_a - features_b) * heads).sum(dim=1)
    likelihoods = _LAPSE_RATE / 2 + (1 - _LAPSE_RATE) * torch.sigmoid(utility_diffs)
    squares = (
        _MATRIX_PRECISION * torch.stack([(matrix**2).sum() for matrix, _ in parameters.layers]).sum()
        + (parameters.shared_head**2).sum() / _SHARED_HEAD_SCALE**2
        + (parameters.deviations**2).sum() / _PERSONAL_HEAD_SCALE**2
    )
    return squares / 2 - torch.log(likelihoods).sum()


def _parameter(values: Float[np.ndarray, "..."]) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float32, requires_grad=True)


def _array(tensor: torch.Tensor) -> Float[np.ndarray, "..."]:
    return tensor.detach().numpy().astype(np.float64)
