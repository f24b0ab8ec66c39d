"""Rewards with a learned feature: a domain that has one feature more, and its bank."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from study_core.bank import Bank, open_bank
from study_core.differences import central_differences
from study_core.distinctness import visible_paths
from study_core.domain import N_, Domain, domain_named
from study_core.online.feature import LearnedFeature
from study_core.posterior.prior import Prior
from study_core.rewards import Rewards
from study_core.scene import Scene

FEATURE_NAME = "learned"
FEATURE_LABEL = N_("Something more that your answers showed")
_MOST_BANKS = 64


class DomainWithFeature:
    """A `Domain` whose trajectories have a learned feature after the hand-coded ones; everything else is as it was.

    Attributes:
        base: The domain without it.
        feature: The learned feature.
    """

    def __init__(self, base: Domain, feature: LearnedFeature) -> None:
        self.base = base
        self.feature = feature
        self.id = f"{FEATURE_NAME}-{feature.digest}+{base.id}"
        self.feature_names = (*base.feature_names, FEATURE_NAME)
        self.feature_labels = (*base.feature_labels, FEATURE_LABEL)
        self.rich_feature_names = base.rich_feature_names
        self.network_input_names = base.network_input_names
        self.control_lower = base.control_lower
        self.control_upper = base.control_upper

    def rollout(self, controls: Float[np.ndarray, "n n_controls"]) -> Float[np.ndarray, "n n_steps n_states"]:
        """See `Domain`."""
        return self.base.rollout(controls)

    def features(self, states: Float[np.ndarray, "n n_steps n_states"]) -> Float[np.ndarray, "n n_features"]:
        """Returns the hand-coded features and the learned one."""
        return np.column_stack([self.base.features(states), self.feature.of_trajectories(self.base, states)])

    def rich_features(self, states: Float[np.ndarray, "n n_steps n_states"]) -> Float[np.ndarray, "n n_rich"]:
        """See `Domain`."""
        return self.base.rich_features(states)

    def network_inputs(
        self, states: Float[np.ndarray, "n n_steps n_states"]
    ) -> Float[np.ndarray, "n n_steps n_inputs"]:
        """See `Domain`."""
        return self.base.network_inputs(states)

    def reward_and_gradient(
        self, controls: Float[np.ndarray, "n n_controls"], weights: Float[np.ndarray, "n n_features"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n_controls"]]:
        """Returns w . Phi and its gradient; how the networks' inputs move with the controls is a central difference."""
        rewards, gradients = self.base.reward_and_gradient(controls, weights[:, :-1])
        inputs, moves = central_differences(self._inputs, controls)
        learned, slopes = self.feature.with_slopes(inputs)
        of_controls = np.einsum("ntk,nctk->nc", slopes, moves)
        return rewards + weights[:, -1] * learned, gradients + weights[:, -1:] * of_controls

    def scene(self, controls: Float[np.ndarray, " n_controls"]) -> Scene:
        """See `Domain`."""
        return self.base.scene(controls)

    def _inputs(self, controls: Float[np.ndarray, "n n_controls"]) -> Float[np.ndarray, "n n_steps n_inputs"]:
        return self.feature.checkpoint.config.inputs_of(self.base, self.base.rollout(controls))


def rewards_with(base: Rewards, feature: LearnedFeature) -> Rewards:
    """Returns rewards that have the feature as well: its weight is uniform with the others on one support more."""
    prior = Prior(base.prior.support, base.prior.n_features + 1)
    bank = None if base.bank is None else _bank_with(base.domain.id, feature)
    return Rewards(DomainWithFeature(base.domain, feature), prior, bank)


@lru_cache(maxsize=_MOST_BANKS)
def _bank_with(domain_id: str, feature: LearnedFeature) -> Bank:
    """Returns the domain's bank, the feature's own drives after the others.

    The domain's drives stay local optima, of rewards in which the feature has no part.
    """
    base = open_bank(domain_named(domain_id))
    domain = DomainWithFeature(domain_named(domain_id), feature)
    without_feature = np.column_stack([base.weights, np.zeros(len(base.weights))])
    added = replace(
        base,
        domain_id=domain.id,
        features=domain.features(domain.rollout(base.controls)),
        weights=without_feature,
    )
    if not len(feature.drives):
        return added
    return replace(
        added,
        controls=np.vstack([base.controls, feature.drives]),
        features=np.vstack([added.features, domain.features(domain.rollout(feature.drives))]),
        weights=np.vstack([without_feature, feature.drive_weights]),
        paths=np.concatenate([base.paths, visible_paths(domain, feature.drives)]),
    )
