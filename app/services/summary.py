"""A session in one record: what was asked, what was answered, what was learned. No clock times, no random ids."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from app.services.runtime import Runtime
from study_core import session_codec
from study_core.evaluation.metrics import accuracy
from study_core.learning import test_comparisons
from study_core.session import SessionState
from study_core.study import Study

Json = dict[str, Any]


def summarise(runtime: Runtime, session_id: str) -> Json:
    """Returns a session's queries, answers, last posterior and test accuracy: a function of study and answers alone.

    Posterior and accuracy are None as long as nothing but practice has been asked.
    """
    live = runtime.live(session_id)
    posteriors = runtime.store.posteriors(session_id)
    last = posteriors[-1] if posteriors else None
    return {
        "study": live.study.name,
        "study_hash": live.study.hash,
        "participant": live.state.participant,
        "queries": _queries(live.state),
        "posterior": None if last is None else {"mean": last.mean.tolist(), **last.summary},
        "test_accuracy": None if last is None else test_accuracy(live.study, live.state, last.mean),
    }


def _queries(state: SessionState) -> list[Json]:
    rows = []
    for prepared, given in zip(state.prepared, state.answers, strict=False):
        rows.append(
            {
                "query_index": prepared.query_index,
                "phase": prepared.phase.value,
                "first_shown": prepared.first_shown,
                **session_codec.proposed_to_json(prepared.proposed),
                "clips": dict(sorted(prepared.clips.items())),
                "choice": given.choice.value,
            }
        )
    return rows


def test_accuracy(
    study: Study, state: SessionState, weights: Float[np.ndarray, " n_weights"]
) -> float | None:
    """Returns the share of test answers that w predicts, of those that prefer one; None without any."""
    answers = test_comparisons(study, state)
    return accuracy(weights, answers) if len(answers) else None
