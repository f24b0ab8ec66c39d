"""Leaving for good: a person takes everything back."""

from __future__ import annotations

from app.services.runtime import Runtime
from app.store import Deletion


def delete(runtime: Runtime, session_id: str) -> Deletion:
    """Deletes a session's person: from the store, and from what this process and its engine know.

    Args:
        runtime: The services' resources.
        session_id: One of the person's sessions.

    Raises:
        SessionDeletedError: It was deleted before.
    """
    live = runtime.live(session_id)
    with live.lock:
        deleted = runtime.store.delete_session(session_id)
    for each in deleted.session_ids:
        runtime.forget(each)
        runtime.on_change(each)
    if runtime.populations is not None:
        # What the others have in common was learned from this person too.
        runtime.populations.begin(live.study)
    return deleted
