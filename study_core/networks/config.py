"""What a feature network is and how it is trained; the defaults are what the paper says (Katz et al. 2021)."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from study_core.domain import Domain
from study_core.errors import NetworkError, UnknownNameError

PUBLISHED_INPUTS = ("x", "distance", "heading", "speed")
PROCEDURES = ("independent", "continued")


@dataclass(frozen=True)
class NetworkConfig:
    """Structure and training of the networks that learn one person's features.

    One network computes phi(inputs of a step) = tanh(V relu(U inputs + b) + c), one number a learned feature, and a
    trajectory's learned features are the sums over its steps. The log-odds of A are w_hc . psi + w_nn . (the learned
    features of A less those of B), where psi holds means over the steps, as everywhere in this project.

    So the scales differ by the number of steps: with 50 of them, the learned part starts with the rationality 50 of
    the paper's formulas, and the hand-coded part has the rationality 1 of its data. That is the published procedure
    (its stored psi are means, its networks are summed), and the learned part is what mostly decides.

    Attributes:
        inputs: The domain's network inputs that are used, by name; the paper's four unless told.
        n_features: Learned features: outputs of the network.
        n_hidden: Rectified linear units of its only hidden layer.
        has_hand_coded: Whether the hand-coded features are part of the reward, or the network alone.
        procedure: `independent`: each trial trains a network of its own. `continued`: the published code's single run
            of all trials' epochs: a trial goes on with the network of the last, and with the optimiser's state.
        n_trials: Trials; the linear weights are reset at the start of each.
        n_epochs: Epochs of a trial; each is one full-batch step of NADAM (Dozat 2016) on all training pairs.
        learning_rate: Of NADAM.
        betas: Of NADAM: how slowly its two moments forget.
        weight_decay: Added to the gradient: this times the network's parameters.
        epochs_per_linear_update: After so many epochs, the linear weights take their steps.
        n_linear_steps: Full-batch gradient steps of one update of the linear weights.
        linear_rate: Their learning rate.
        training_share: Share of the answers, the first ones, that train; the rest validate. With 1 nothing does.
        n_selected: Trials that are kept, the best on validation.
    """

    inputs: tuple[str, ...] = PUBLISHED_INPUTS
    n_features: int = 1
    n_hidden: int = 100
    has_hand_coded: bool = True
    procedure: str = "independent"
    n_trials: int = 40
    n_epochs: int = 40
    learning_rate: float = 0.001
    betas: tuple[float, float] = (0.9, 0.999)
    weight_decay: float = 0.0
    epochs_per_linear_update: int = 20
    n_linear_steps: int = 5
    linear_rate: float = 0.005
    training_share: float = 0.7
    n_selected: int = 5

    def __post_init__(self) -> None:
        if not self.inputs or len(set(self.inputs)) != len(self.inputs):
            raise NetworkError(
                f"Expected `inputs` to be different names, got {self.inputs!r}. Name each once."
            )
        if self.procedure not in PROCEDURES:
            raise UnknownNameError("training procedure", self.procedure, PROCEDURES)
        counts = ("n_features", "n_hidden", "n_trials", "n_epochs", "epochs_per_linear_update", "n_selected")
        for name in counts:
            _check(name, getattr(self, name), getattr(self, name) >= 1, "at least 1")
        for name in ("n_linear_steps", "weight_decay"):
            _check(name, getattr(self, name), getattr(self, name) >= 0, "at least 0")
        for name in ("learning_rate", "linear_rate"):
            _check(name, getattr(self, name), 0.0 < getattr(self, name) < np.inf, "positive")
        _check("betas", self.betas, all(0.0 <= beta < 1.0 for beta in self.betas), "in [0, 1)")
        _check("training_share", self.training_share, 0.0 < self.training_share <= 1.0, "in (0, 1]")
        _check("n_selected", self.n_selected, self.n_selected <= self.n_trials, "at most n_trials")
        keeps_all = self.n_selected == self.n_trials
        _check(
            "n_selected",
            self.n_selected,
            keeps_all or self.training_share < 1.0,
            "n_trials without validation",
        )

    def to_json(self) -> str:
        """Returns the configuration as one line, the same for equal configurations."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> NetworkConfig:
        """Returns what `to_json` wrote.

        Raises:
            ValueError: It isn't JSON.
            TypeError: It isn't a configuration.
            NetworkError: A value is out of its range.
        """
        values: dict[str, Any] = json.loads(text)
        tuples: dict[str, Any] = {
            name: tuple(value) for name, value in values.items() if isinstance(value, list)
        }
        return cls(**values | tuples)

    @property
    def digest(self) -> str:
        """Returns the SHA-256 of the configuration, in hex."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    def inputs_of(
        self, domain: Domain, states: Float[np.ndarray, "n n_steps n_states"]
    ) -> Float[np.ndarray, "n n_steps n_inputs"]:
        """Returns the chosen inputs at each step.

        Raises:
            UnknownNameError: The domain has no input of a name.
        """
        names = domain.network_input_names
        for name in self.inputs:
            if name not in names:
                raise UnknownNameError(f"network input of '{domain.id}'", name, names)
        return domain.network_inputs(states)[..., [names.index(name) for name in self.inputs]]


def _check(name: str, value: object, is_right: bool, expected: str) -> None:
    if not is_right:
        raise NetworkError(f"Expected `{name}` to be {expected}, got {value!r}. Change the configuration.")
