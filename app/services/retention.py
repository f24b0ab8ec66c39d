"""Forgetting: ids by which others know people are kept no longer than their study says."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from app.store import Store
from study_core.study import parse_study

RETENTION = "retention"
"""Who forgets, in the audit."""


def forget_ids(store: Store) -> dict[str, int]:
    """Forgets the external ids whose time is over.

    The newest version of a study decides for all people of that study.

    Returns:
        By study, of how many people; without those of whom nothing was forgotten.
    """
    newest: dict[str, str] = {}
    for record in store.studies():
        newest.setdefault(record.name, record.study_hash)
    forgotten = {}
    for name, study_hash in newest.items():
        days = parse_study(store.study_text(study_hash)).file.data.forget_ids_after_days
        if days is None:
            continue
        n_people = store.forget_external_people(name, datetime.now(UTC) - timedelta(days=days))
        if n_people:
            forgotten[name] = n_people
            store.desk.record(RETENTION, "ids_forgotten", name, {"n_people": n_people, "days": days})
    return forgotten
