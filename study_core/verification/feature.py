"""Whether a feature that was learned in the middle of a session is what its session could have learned."""

from __future__ import annotations

import hashlib

import numpy as np

from study_core.events import FeatureLearned
from study_core.learning import compared, feature_due
from study_core.online.feature import Compared, LearnedFeature
from study_core.online.learn import CONFIG, drawn_drive_weights
from study_core.online.rewards import DomainWithFeature
from study_core.session import SessionState
from study_core.study import Study
from study_core.verification.drives import verify_optimum
from study_core.verification.findings import ROUNDING, Findings

# The networks' numbers are in single precision.
_SINGLE = 1e-5

_TRAINING = "trainings of a learned feature"


def verify_feature(findings: Findings, study: Study, state: SessionState, event: FeatureLearned) -> None:
    """Verifies when a feature was learned, from what, how large it is, and its drives; not the training itself.

    Args:
        findings: Told what isn't so.
        study: The study.
        state: The session before it.
        event: What was learned.
    """
    due = feature_due(study, state, event.query_index)
    findings.compare("feature.n_queries", event.n_queries, None if due is None else due.n_queries)
    findings.leave_out(_TRAINING)
    if event.feature is None or due is None:
        return
    assert state.participant is not None, "a session with answers has begun"
    judged = compared(state, event.n_queries)
    _verify_lineage(findings, study, event.feature, judged)
    _verify_size(findings, study, event.feature, judged)
    drawn = drawn_drive_weights(study, state.participant, event.n_queries)
    domain = DomainWithFeature(study.domain, event.feature)
    for row, weights in enumerate(event.feature.drive_weights):
        nearest = drawn[np.abs(drawn - weights).max(axis=1).argmin()]
        findings.compare_all(f"feature.drive_weights[{row}]", weights, nearest, ROUNDING)
        verify_optimum(
            findings, f"reward of feature.drives[{row}]", domain, event.feature.drives[row], weights
        )


def _verify_lineage(findings: Findings, study: Study, feature: LearnedFeature, judged: Compared) -> None:
    lineage = feature.checkpoint.lineage
    answers = hashlib.sha256(judged.controls.tobytes() + judged.comparisons.signs.tobytes()).hexdigest()
    findings.compare("feature.n_learned_from", feature.n_learned_from, len(judged.comparisons))
    findings.compare("feature.answers_digest", lineage.answers_digest, answers)
    findings.compare("feature.config_digest", feature.checkpoint.config.digest, CONFIG.digest)
    findings.compare("feature.domain_id", lineage.domain_id, study.domain.id)
    findings.compare("feature.seed", lineage.seed, study.seed)


def _verify_size(findings: Findings, study: Study, feature: LearnedFeature, judged: Compared) -> None:
    """Verifies that the feature spreads over its drives as much as the hand-coded ones do."""
    domain = study.domain
    states = domain.rollout(judged.controls.reshape(-1, judged.controls.shape[2]))
    expected = float(np.sqrt(domain.features(states).var(axis=0).mean()))
    spread = float(feature.of_trajectories(domain, states).std())
    findings.compare("spread of the feature", spread / expected, 1.0, _SINGLE)
