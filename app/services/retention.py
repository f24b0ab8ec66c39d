"""Forgetting: ids by which others know people are kept no longer than their study says."""

from __future__ import annotations

import logging
import threading
from datetime import UTC, datetime, timedelta

from app.store import Store, StoreError
from study_core.study import parse_study

_A_DAY_S = 86_400.0

log = logging.getLogger(__name__)

RETENTION = "retention"
"""Who forgets, in the audit."""


class DailyForgetting:
    """Forgets what is to be forgotten, now and once a day, in a thread of its own."""

    def __init__(self, store: Store) -> None:
        """Begins at once.

        Args:
            store: Stays open until this is closed.
        """
        self._store = store
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._go_on, name="retention", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Waits for what is being forgotten, and ends."""
        self._is_over.set()
        self._thread.join()

    def _go_on(self) -> None:
        while True:
            try:
                forget_ids(self._store)
            except StoreError:
                log.exception("ids could not be forgotten; they will be tomorrow")
            if self._is_over.wait(_A_DAY_S):
                return


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
