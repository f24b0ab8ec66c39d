"""The one exception to append-only: a person takes back everything they gave.

What was learned from them goes as well, from whatever it stands in: shared models, and the logs of those who started
from one, who go on from their study file's prior.
"""

from __future__ import annotations

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from app.store import events, external, learned
from app.store.models import PersonalModelRow, SessionRow, TombstoneRow
from app.store.records import Deletion
from app.store.utc import now


def delete_session(rows: Session, session_id: str) -> Deletion:
    """Removes a session's person: all their sessions with what was derived from them; each leaves a tombstone."""
    parts = [_delete_one(rows, each) for each in external.sessions_of_same_person(rows, session_id)]
    return Deletion(
        session_ids=tuple(session_id for part in parts for session_id in part.session_ids),
        n_answers=sum(part.n_answers for part in parts),
        n_personal_models=sum(part.n_personal_models for part in parts),
        n_shared_models=sum(part.n_shared_models for part in parts),
        is_wiped=False,
    )


def _delete_one(rows: Session, session_id: str) -> Deletion:
    n_answers = events.n_answers(rows, session_id)
    n_personal_models = rows.scalar(
        select(func.count()).select_from(PersonalModelRow).where(PersonalModelRow.session_id == session_id)
    )
    n_shared_models = learned.drop_shared_of(rows, session_id)
    events.withdraw_populations(rows, session_id)
    # The log, the posteriors, the browser's measures, the person's own models, what opens the session and who they are
    # to others go with it.
    rows.execute(delete(SessionRow).where(SessionRow.id == session_id))
    rows.add(TombstoneRow(session_id=session_id, deleted_at=now()))
    return Deletion((session_id,), n_answers, n_personal_models or 0, n_shared_models, is_wiped=False)
