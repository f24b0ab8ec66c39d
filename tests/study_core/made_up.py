"""Made-up queries for what only carries them."""

import numpy as np

from study_core.comparison import Choice, Query
from study_core.events import QueryPrepared
from study_core.networks.checkpoint import Checkpoint, Lineage
from study_core.networks.config import NetworkConfig
from study_core.networks.model import initial_networks
from study_core.online.feature import N_FOLDS, LearnedFeature
from study_core.plan import Phase
from study_core.queries import ProposedQuery, Provenance


def proposed(index, n_features=4, seed=0):
    """A query nobody optimised, whose numbers need all their bits."""
    rng = np.random.default_rng([seed, index])
    query = Query(
        rng.normal(size=10), rng.normal(size=10), rng.normal(size=n_features), rng.normal(size=n_features)
    )
    provenance = Provenance(
        study_hash="0f" * 32,
        seed=2**40 + 1,
        stream=("rehearsal", index) if index % 2 else (3, index),
        method="heuristic",
        versions=("driving-v1", "sampler-1", "optimiser-1"),
        bank_digest="ba" * 32 if index % 2 else None,
        weights_a=rng.random(n_features),
        weights_b=rng.random(n_features),
        score=float(rng.normal()),
        runner_up_score=None if index % 3 == 0 else float(rng.normal()),
        pairs_tried=1 + index,
        has_converged=(True, bool(index % 2)),
        are_distinct=bool(index % 5),
        visible_difference=float(rng.random()),
    )
    return ProposedQuery(query, provenance)


def prepared(index, phase=Phase.ACTIVE, seed=0):
    clips = {"wide": f"{index:02x}" * 32, "tall": "ab" * 32}
    return QueryPrepared(index, phase, proposed(index, seed=seed), clips, "0.1.0", 12.5 + index / 3, Choice.A)


def learned_feature(n_learned_from=16, seed=0):
    """A feature that nothing has taught: its networks are as they are before training."""
    config = NetworkConfig(has_hand_coded=False, n_hidden=6, n_trials=1, n_selected=1, training_share=1.0)
    rng = np.random.default_rng(seed)
    networks = initial_networks(rng.spawn(N_FOLDS), 4, config.n_hidden, 1, np.empty(0))
    lineage = Lineage("0a" * 32, config.digest, "driving-v1", ("prefstudy-0.1.0", "feature-network-1"), 5)
    drives, weights = rng.uniform(-1.0, 1.0, (3, 10)), rng.random((3, 5))
    return LearnedFeature(Checkpoint(networks, config, lineage), n_learned_from, drives, weights)
