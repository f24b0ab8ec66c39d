"""Made-up queries for what only carries them."""

import numpy as np

from study_core.comparison import Query
from study_core.queries import ProposedQuery, Provenance
from study_core.session import Phase, QueryPrepared


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
    return QueryPrepared(index, phase, proposed(index, seed=seed), clips, "0.1.0", 12.5 + index / 3)
