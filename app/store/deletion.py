"""The one exception to append-only: a person takes back everything they gave.

What was learned from them goes as well, from whatever it stands in: shared models, and the logs of those who started
from one, who go on from their study file's prior.
"""

from __future__ import annotations

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from app.store import events, learned
from app.store.models import PersonalModelRow, SessionRow, TombstoneRow
from app.store.records import Deletion
from app.store.utc import now


def delete_session(rows: Session, session_id: str) -> Deletion:
    """Removes a session with all that was derived from it, and leaves a tombstone."""
    n_answers = events.n_answers(rows, session_id)
    n_personal_models = rows.scalar(
        select(func.count()).select_from(PersonalModelRow).where(PersonalModelRow.session_id == session_id)
    )
    n_shared_models = learned.drop_shared_of(rows, session_id)
    events.withdraw_populations(rows, session_id)
    # The log, the posteriors, the browser's measures and the person's own models go with the session.
    rows.execute(delete(SessionRow).where(SessionRow.id == session_id))
    rows.add(TombstoneRow(session_id=session_id, deleted_at=now()))
    return Deletion(n_answers, n_personal_models or 0, n_shared_models, is_wiped=False)
