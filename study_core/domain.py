"""The contract that every domain plug-in keeps, and the registry that finds it by name.

A domain is found through the entry-point group `prefstudy.domains`; the built-in ones register there
exactly like a third-party package does. `study_core.domain_check.check_domain` verifies the contract.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from study_core.errors import UnknownNameError
from study_core.scene import Scene

ENTRY_POINT_GROUP = "prefstudy.domains"


@runtime_checkable
class Domain(Protocol):
    """A robot task whose trajectories people compare. All methods are pure and batched over trajectories.

    Attributes:
        id: Name with a version, e.g. `driving-v1`; changed numbers are a new id, so old sessions replay.
        feature_names: Names of the hand-coded features, higher is better, length `n_features`.
        feature_labels: What each of these is to the people who are asked, in a few English words; `N_` marks them.
        rich_feature_names: Names of the rich features, length `n_rich`.
        network_input_names: Names of all per-step inputs that a feature network may have; its configuration chooses.
        control_lower: Lower bound of each control, shape `(n_controls,)`.
        control_upper: Upper bound of each control, shape `(n_controls,)`.
    """

    id: str
    feature_names: tuple[str, ...]
    feature_labels: tuple[str, ...]
    rich_feature_names: tuple[str, ...]
    network_input_names: tuple[str, ...]
    control_lower: Float[np.ndarray, " n_controls"]
    control_upper: Float[np.ndarray, " n_controls"]

    def rollout(self, controls: Float[np.ndarray, "n n_controls"]) -> Float[np.ndarray, "n n_steps n_states"]:
        """Returns the states after each step."""
        ...

    def features(self, states: Float[np.ndarray, "n n_steps n_states"]) -> Float[np.ndarray, "n n_features"]:
        """Returns the hand-coded features of each trajectory, averaged over its steps (Phi)."""
        ...

    def rich_features(self, states: Float[np.ndarray, "n n_steps n_states"]) -> Float[np.ndarray, "n n_rich"]:
        """Returns whatever of a whole trajectory people may like or mind; signs and scales are left to be learned."""
        ...

    def network_inputs(
        self, states: Float[np.ndarray, "n n_steps n_states"]
    ) -> Float[np.ndarray, "n n_steps n_inputs"]:
        """Returns what a feature network may see at each step, in the order of `network_input_names`.

        Networks take the numbers as they are: finite for any drive within the bounds, and of a size around 1.
        """
        ...

    def reward_and_gradient(
        self, controls: Float[np.ndarray, "n n_controls"], weights: Float[np.ndarray, "n n_features"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_controls"]]:
        """Returns each trajectory's reward w . Phi under its own weights, and its gradient in the controls."""
        ...

    def scene(self, controls: Float[np.ndarray, " n_controls"]) -> Scene:
        """Returns what to draw for one trajectory, its start included."""
        ...


def N_(words: str) -> str:  # noqa: N802 (gettext's own name)
    """Marks words for the catalogues; it is the pages that translate them."""
    return words


@cache
def domain_named(domain_id: str) -> Domain:
    """Returns the registered domain of that id.

    Raises:
        UnknownNameError: No plug-in registers the id; the message suggests the closest one.
    """
    found = {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}
    if domain_id not in found:
        raise UnknownNameError("domain", domain_id, found)
    domain: Domain = found[domain_id].load()
    return domain
