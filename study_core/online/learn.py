"""How a feature is learned in the middle of a session: by small networks, of what the hand-coded rewards don't explain.

The posterior of the hand-coded weights comes first, under the study's own response model; networks with weight decay
learn the rest of the log-odds, as in `study_core.predictors.personal_calibrated`. Each fold of the answers is left out
once.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields, replace
from importlib.metadata import version

import numpy as np
from jaxtyping import Float, Int

from study_core import lbfgs
from study_core.comparison import ComparisonSet
from study_core.distinctness import distinct_rows, visible_paths
from study_core.domain import Domain
from study_core.networks.checkpoint import Checkpoint, Lineage
from study_core.networks.config import NetworkConfig
from study_core.networks.model import Examples, Networks
from study_core.networks.training import VERSION, Lesson, train
from study_core.online.feature import N_FOLDS, Compared, LearnedFeature
from study_core.online.rewards import rewards_with
from study_core.posterior.prior import Prior
from study_core.posterior.run import infer
from study_core.queries import Participant
from study_core.streams import stream
from study_core.study import Study

CONFIG = NetworkConfig(
    has_hand_coded=False, n_trials=2, n_selected=2, n_epochs=160, training_share=1.0, weight_decay=0.03
)
"""The networks of one fold; epochs and decay were chosen on simulated people with a hidden taste (see DECISIONS.md)."""

_N_DRIVES = 32
# In body lengths; drives of the feature's own that look more alike are one.
_LEAST_DIFFERENCE = 0.01


def learn_feature(
    study: Study,
    participant: Participant,
    n_queries: int,
    compared: Compared,
) -> LearnedFeature:
    """Returns the feature that a session's answers so far teach.

    Args:
        study: The study; what it knows besides its file has no part in this.
        participant: Names the session's random streams.
        n_queries: How many queries have been asked; names the streams, too.
        compared: The active answers so far that say something; at least `schedule.FEWEST_ANSWERS` prefer one of the
            two.

    Raises:
        NetworkError: The training diverged.
    """
    rng = _stream(study, participant, n_queries)
    domain, comparisons, controls = study.domain, compared.comparisons, compared.controls
    inputs = [CONFIG.inputs_of(domain, domain.rollout(controls[:, side])) for side in (0, 1)]
    fold = np.arange(len(comparisons)) % N_FOLDS
    prefers = comparisons.signs != 0.0
    parts = [
        _learn_fold(one, study, comparisons, inputs, np.flatnonzero(prefers & (fold != left_out)))
        for left_out, one in enumerate(rng.spawn(N_FOLDS))
    ]
    networks = Networks(
        *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Networks))
    )
    lineage = Lineage(
        hashlib.sha256(controls.tobytes() + comparisons.signs.tobytes()).hexdigest(),
        CONFIG.digest,
        domain.id,
        (f"prefstudy-{version('prefstudy')}", VERSION),
        study.seed,
    )
    n_controls, n_weights = len(domain.control_lower), len(domain.feature_names) + 1
    none = np.empty((0, n_controls)), np.empty((0, n_weights))
    feature = LearnedFeature(Checkpoint(networks, CONFIG, lineage), len(comparisons), *none)
    feature = _as_large_as_the_others(feature, domain, controls)
    return feature if study.bank is None else _with_drives(rng, study, feature)


def _learn_fold(
    rng: np.random.Generator,
    study: Study,
    comparisons: ComparisonSet,
    inputs: list[Float[np.ndarray, "n n_steps n_inputs"]],
    rows: Int[np.ndarray, " n_rows"],
) -> Networks:
    """Returns networks that know these answers."""
    known = ComparisonSet(comparisons.feature_diffs[rows], comparisons.signs[rows])
    posterior = infer(rng, study.prior, study.response, known, study.sampler)
    rationality = posterior.parameters.rationality
    base_logits = known.feature_diffs @ (rationality[:, None] * posterior.samples).mean(axis=0)
    pairs = Examples(inputs[0][rows], inputs[1][rows], np.empty((len(rows), 0)), base_logits)
    lesson = Lesson(pairs, known.signs, np.empty(0), float(posterior.parameters.lapse_rate.mean()))
    return train(rng, CONFIG, lesson).networks


def _as_large_as_the_others(
    feature: LearnedFeature, domain: Domain, controls: Float[np.ndarray, "n 2 n_controls"]
) -> LearnedFeature:
    """Returns the feature with the spread that the hand-coded ones have, in their mean square, over these drives.

    The prior of the weights is uniform, so what a feature is worth beforehand is a matter of its scale.
    """
    states = domain.rollout(controls.reshape(-1, controls.shape[2]))
    spread = np.sqrt(domain.features(states).var(axis=0).mean())
    scale = spread / feature.of_trajectories(domain, states).std()
    networks = feature.checkpoint.networks
    scaled = replace(networks, linear_weights=scale * networks.linear_weights)
    return replace(feature, checkpoint=replace(feature.checkpoint, networks=scaled))


def _with_drives(rng: np.random.Generator, study: Study, feature: LearnedFeature) -> LearnedFeature:
    """Returns the feature with drives that are best for rewards in which it has a part."""
    rewards = rewards_with(study.rewards, feature)
    domain, bank = rewards.domain, rewards.bank
    assert bank is not None, "drives are looked for where there is a bank"
    weights = _draw_drive_weights(rng, study)
    starts = bank.controls[np.argmax(weights @ bank.features.T, axis=1)]
    controls, _, has_converged, _ = lbfgs.maximise(domain, starts, weights)
    controls, weights = controls[has_converged], weights[has_converged]
    rows = distinct_rows(visible_paths(domain, controls), _LEAST_DIFFERENCE)
    return replace(feature, drives=controls[rows], drive_weights=weights[rows])


def drawn_drive_weights(
    study: Study, participant: Participant, n_queries: int
) -> Float[np.ndarray, "n_drives n_weights"]:
    """Returns the weights for which a feature's drives were looked for, found or not.

    Args:
        study: The study.
        participant: Names the session's random streams.
        n_queries: How many queries had been asked.
    """
    return _draw_drive_weights(_stream(study, participant, n_queries), study)


def _draw_drive_weights(rng: np.random.Generator, study: Study) -> Float[np.ndarray, "n_drives n_weights"]:
    return Prior(study.prior.support, study.prior.n_features + 1).draw(rng, _N_DRIVES)


def _stream(study: Study, participant: Participant, n_queries: int) -> np.random.Generator:
    return stream(study.seed, "feature", participant, n_queries)
