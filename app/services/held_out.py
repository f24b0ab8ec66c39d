"""What people answered to the common test queries: for the evaluation alone.

Nothing that learns may import this module; import-linter keeps it so.
"""

from __future__ import annotations

from app.store import SessionRecord, Store
from study_core import session_codec
from study_core.evaluation.people import TestAnswers
from study_core.plan import Phase
from study_core.preferences import preferences
from study_core.study import parse_study


def held_out(store: Store, record: SessionRecord) -> TestAnswers:
    """Returns what a person has answered to test queries so far, where one of the two was preferred."""
    study = parse_study(store.study_text(record.study_hash))
    events = (session_codec.from_json(event.kind, event.payload) for event in store.events(record.id))
    return TestAnswers(*preferences(study.domain, events, Phase.TEST))
