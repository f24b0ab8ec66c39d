"""What people answered to the common test queries: for the evaluation alone.

Nothing that learns may import this module; import-linter keeps it so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.store import SessionRecord, Store
from study_core import session_codec
from study_core.predictors.predictor import Pairs
from study_core.preferences import preferences
from study_core.session import Phase, reduce
from study_core.study import parse_study


@dataclass(frozen=True)
class HeldOut:
    """One person's answers to test queries, of those that prefer one of the two.

    Attributes:
        pairs: What was compared, in the order it was asked.
        signs: +1 where A was preferred, -1 where B was, shape `(n,)`.
    """

    pairs: Pairs
    signs: Float[np.ndarray, " n"]


def held_out(store: Store, record: SessionRecord) -> HeldOut:
    """Returns what a person has answered to test queries so far."""
    study = parse_study(store.study_text(record.study_hash))
    events = store.events(record.id)
    state = reduce(study, (session_codec.from_json(event.kind, event.payload) for event in events))
    first = sum(query.phase is Phase.ACTIVE for query in state.prepared)
    return HeldOut(*preferences(study.domain, state.prepared[first:], state.answers[first:]))
