"""Feature networks as data: several of one structure, and what they make of trajectories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from study_core.networks import kernels


@dataclass(frozen=True)
class Examples:
    """Pairs of trajectories as networks see them, answered or not.

    Attributes:
        inputs_a: Inputs at each step of A, shape `(n, n_steps, n_inputs)`.
        inputs_b: The same of B.
        hand_coded_diffs: psi of each pair, shape `(n, n_hand_coded)`; no columns for a network alone.
        base_logits: Log-odds of A that are known beforehand and stay as they are, shape `(n,)`.
    """

    inputs_a: Float[np.ndarray, "n n_steps n_inputs"]
    inputs_b: Float[np.ndarray, "n n_steps n_inputs"]
    hand_coded_diffs: Float[np.ndarray, "n n_hand_coded"]
    base_logits: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.inputs_a)

    def __getitem__(self, rows: slice | Int[np.ndarray, " n_rows"]) -> Examples:
        return Examples(
            self.inputs_a[rows], self.inputs_b[rows], self.hand_coded_diffs[rows], self.base_logits[rows]
        )

    @property
    def packed_inputs(self) -> Float32[np.ndarray, "n_padded n_samples"]:
        """Returns the inputs as the kernels take them: pair by pair, A's steps and then B's, padded with zeros."""
        n_inputs = self.inputs_a.shape[2]
        both = np.stack([self.inputs_a, self.inputs_b], axis=1).reshape(-1, n_inputs)
        packed = np.zeros((_padded(n_inputs), len(both)), dtype=np.float32)
        packed[:n_inputs] = both.T
        return packed


@dataclass(frozen=True)
class Networks:
    """Feature networks of one structure, with the linear weights that go with each.

    Attributes:
        hidden_weights: U, shape `(n_networks, n_hidden, n_inputs)`.
        hidden_biases: b, shape `(n_networks, n_hidden)`.
        output_weights: V, shape `(n_networks, n_features, n_hidden)`.
        output_biases: c, shape `(n_networks, n_features)`.
        linear_weights: w of the hand-coded features, if they have a part, and then of the learned ones, shape
            `(n_networks, n_hand_coded + n_features)`.
    """

    hidden_weights: Float32[np.ndarray, "n_networks n_hidden n_inputs"]
    hidden_biases: Float32[np.ndarray, "n_networks n_hidden"]
    output_weights: Float32[np.ndarray, "n_networks n_features n_hidden"]
    output_biases: Float32[np.ndarray, "n_networks n_features"]
    linear_weights: Float[np.ndarray, "n_networks n_linear"]

    def __len__(self) -> int:
        return len(self.hidden_weights)

    def __getitem__(self, rows: slice | Int[np.ndarray, " n_rows"]) -> Networks:
        return Networks(
            self.hidden_weights[rows],
            self.hidden_biases[rows],
            self.output_weights[rows],
            self.output_biases[rows],
            self.linear_weights[rows],
        )

    @property
    def kernel_shape(self) -> tuple[int, int, int]:
        """Returns the sizes as the kernels take them."""
        _, n_features, n_hidden = self.output_weights.shape
        return _padded(self.hidden_weights.shape[2]), n_hidden, n_features

    @property
    def packed(self) -> Float32[np.ndarray, "n_networks n_parameters"]:
        """Returns each network's parameters as the kernels take them: one vector, inputs padded with zeros."""
        n, _, n_inputs = self.hidden_weights.shape
        missing = _padded(n_inputs) - n_inputs
        parts = (
            np.pad(self.hidden_weights, ((0, 0), (0, 0), (0, missing))),
            self.hidden_biases,
            self.output_weights,
            self.output_biases,
        )
        return np.hstack([part.reshape(n, -1) for part in parts])

    def unpacked(
        self,
        packed: Float32[np.ndarray, "n n_parameters"],
        linear_weights: Float[np.ndarray, "n n_linear"],
    ) -> Networks:
        """Returns networks of this structure with other parameters, packed as in `packed`."""
        n_padded, n_hidden, n_features = self.kernel_shape
        ends = np.cumsum([n_hidden * n_padded, n_hidden, n_features * n_hidden])
        hidden, hidden_biases, output, output_biases = np.split(packed, ends, axis=1)
        return Networks(
            hidden.reshape(-1, n_hidden, n_padded)[..., : self.hidden_weights.shape[2]],
            hidden_biases,
            output.reshape(-1, n_features, n_hidden),
            output_biases,
            linear_weights,
        )

    def feature_diffs(self, pairs: Examples) -> Float[np.ndarray, "n_networks n n_features"]:
        """Returns each network's learned features of A less those of B, summed over the steps."""
        inputs, n_steps = pairs.packed_inputs, pairs.inputs_a.shape[1]
        return np.stack(
            [kernels.feature_diffs(self.kernel_shape, inputs, n_steps, row) for row in self.packed]
        )

    def learned_logits(self, pairs: Examples) -> Float[np.ndarray, "n_networks n"]:
        """Returns what each network's learned features alone add to the log-odds of A."""
        learned_weights = self.linear_weights[:, -self.output_biases.shape[1] :]
        return np.einsum("mnf,mf->mn", self.feature_diffs(pairs), learned_weights)

    def logits(self, pairs: Examples) -> Float[np.ndarray, "n_networks n"]:
        """Returns each network's log-odds of A, lapses apart: base, hand-coded part and learned part."""
        hand_coded_weights = self.linear_weights[:, : -self.output_biases.shape[1]]
        return pairs.base_logits + hand_coded_weights @ pairs.hand_coded_diffs.T + self.learned_logits(pairs)


def _padded(n_inputs: int) -> int:
    return -(-n_inputs // kernels.INPUTS_AT_ONCE) * kernels.INPUTS_AT_ONCE


def initial_networks(
    rngs: list[np.random.Generator],
    n_inputs: int,
    n_hidden: int,
    n_features: int,
    hand_coded_weights: Float[np.ndarray, " n_hand_coded"],
) -> Networks:
    """Returns untrained networks: Xavier initialisation (Glorot and Bengio 2010, eq. 16) and biases of 0.

    Args:
        rngs: One for each network.
        n_inputs: Inputs of a step.
        n_hidden: Hidden units.
        n_features: Learned features; their linear weights are uniform on [0, 1].
        hand_coded_weights: Linear weights of the hand-coded features; none for networks alone.
    """
    n = len(rngs)
    return Networks(
        hidden_weights=np.stack([_xavier(rng, n_hidden, n_inputs) for rng in rngs]),
        hidden_biases=np.zeros((n, n_hidden), dtype=np.float32),
        output_weights=np.stack([_xavier(rng, n_features, n_hidden) for rng in rngs]),
        output_biases=np.zeros((n, n_features), dtype=np.float32),
        linear_weights=np.stack(
            [np.append(hand_coded_weights, rng.uniform(0.0, 1.0, n_features)) for rng in rngs]
        ),
    )


def _xavier(rng: np.random.Generator, n_out: int, n_in: int) -> Float32[np.ndarray, "n_out n_in"]:
    bound = np.sqrt(6.0 / (n_in + n_out))
    return rng.uniform(-bound, bound, (n_out, n_in)).astype(np.float32)
