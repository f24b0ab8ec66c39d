"""A feature that a person's own answers have taught: what the hand-coded features miss, in units of reward."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from study_core.comparison import ComparisonSet
from study_core.domain import Domain
from study_core.networks.checkpoint import Checkpoint, to_bytes
from study_core.networks.model import Examples, Networks

N_FOLDS = 5
"""Networks are trained without one fold of the answers each, so that every answer has networks that don't know it."""


@dataclass(frozen=True)
class Compared:
    """Answers with the trajectories that they compared.

    Attributes:
        comparisons: The answers, in the hand-coded features.
        controls: Of A and B of each, shape `(n, 2, n_controls)`.
    """

    comparisons: ComparisonSet
    controls: Float[np.ndarray, "n 2 n_controls"]


@dataclass(frozen=True, eq=False)
class LearnedFeature:
    """Networks whose mean is one more feature of a trajectory; only its differences mean anything.

    The answers that taught a feature would overstate its worth: the networks know them by heart. So the feature of a
    pair among them is what the networks say that were trained without it, as in stacking (Wolpert 1992).

    Attributes:
        checkpoint: The networks, fold by fold, as many for each.
        n_learned_from: How many answers taught it, the first ones; answer i is in fold i modulo `N_FOLDS`.
        drives: Controls of local optima of rewards that the feature has a part in, shape `(n_drives, n_controls)`;
            none where the study has no bank.
        drive_weights: The weights of the reward that each is an optimum of, the feature's last, shape
            `(n_drives, n_features + 1)`.
    """

    checkpoint: Checkpoint
    n_learned_from: int
    drives: Float[np.ndarray, "n_drives n_controls"]
    drive_weights: Float[np.ndarray, "n_drives n_weights"]

    @cached_property
    def digest(self) -> str:
        """Returns the SHA-256 of everything in it, in hex; features are equal if their digests are."""
        digest = hashlib.sha256(to_bytes(self.checkpoint))
        digest.update(f"{self.n_learned_from}".encode())
        digest.update(self.drives.tobytes())
        digest.update(self.drive_weights.tobytes())
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LearnedFeature) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def of_trajectories(
        self, domain: Domain, states: Float[np.ndarray, "n n_steps n_states"]
    ) -> Float[np.ndarray, " n"]:
        """Returns the feature of each trajectory, less that of inputs that are all zero.

        Args:
            domain: Gives the networks' inputs.
            states: After each step.
        """
        inputs = self.checkpoint.config.inputs_of(domain, states)
        return self._of_each_fold(inputs, np.zeros_like(inputs)).mean(axis=0)

    def with_slopes(
        self, inputs: Float[np.ndarray, "n n_steps n_inputs"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_steps n_inputs"]]:
        """Returns what `of_trajectories` does, and its slopes in the networks' inputs.

        In double precision, since a climb needs values as smooth as its slopes.
        """
        values, slopes = np.zeros(len(inputs)), np.zeros_like(inputs)
        networks = self.checkpoint.networks
        for row in range(len(networks)):
            hidden_weights = networks.hidden_weights[row].astype(np.float64)
            to_outputs = networks.output_weights[row].astype(np.float64)
            hidden = inputs @ hidden_weights.T + networks.hidden_biases[row]
            outputs = np.tanh(np.maximum(hidden, 0.0) @ to_outputs.T + networks.output_biases[row])
            at_zero = (
                np.maximum(networks.hidden_biases[row], 0.0) @ to_outputs.T + networks.output_biases[row]
            )
            linear = networks.linear_weights[row] / len(networks)
            values += (outputs - np.tanh(at_zero)).sum(axis=1) @ linear
            slopes += ((1.0 - outputs**2) * linear @ to_outputs * (hidden > 0.0)) @ hidden_weights
        return values, slopes

    def added_to(self, domain: Domain, compared: Compared) -> ComparisonSet:
        """Returns a session's answers, in their order, in the hand-coded features and this one.

        Args:
            domain: Gives the networks' inputs.
            compared: All the answers so far, those that taught the feature first.
        """
        config, comparisons = self.checkpoint.config, compared.comparisons
        inputs = [config.inputs_of(domain, domain.rollout(compared.controls[:, side])) for side in (0, 1)]
        of_folds = self._of_each_fold(*inputs)
        diffs = of_folds.mean(axis=0)
        known = np.arange(self.n_learned_from)
        diffs[known] = of_folds[known % N_FOLDS, known]
        return ComparisonSet(np.column_stack([comparisons.feature_diffs, diffs]), comparisons.signs)

    def _of_each_fold(
        self,
        inputs_a: Float[np.ndarray, "n n_steps n_inputs"],
        inputs_b: Float[np.ndarray, "n n_steps n_inputs"],
    ) -> Float[np.ndarray, "n_folds n"]:
        """Returns the mean over each fold's networks of the feature of A less that of B."""
        networks: Networks = self.checkpoint.networks
        n = len(inputs_a)
        pairs = Examples(inputs_a, inputs_b, np.empty((n, 0)), np.zeros(n))
        return networks.learned_logits(pairs).reshape(N_FOLDS, -1, n).mean(axis=1)
