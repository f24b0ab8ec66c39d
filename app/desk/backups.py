"""A copy of the whole database to download: for owners, who have it all anyway."""

from __future__ import annotations

import tempfile
from datetime import UTC, datetime
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse, Response
from starlette.background import BackgroundTask

from app.desk.admission import Admitted, Here
from app.desk.parts import DeskParts
from app.store.backup import back_up

SQLITE = "application/vnd.sqlite3"


def backup_routes(parts: DeskParts) -> APIRouter:
    """Returns the desk's route of backups."""
    router = APIRouter()

    @router.get("/backup")
    def backup(here: Here) -> Response:
        return backup_file(parts, here)

    return router


def backup_file(parts: DeskParts, here: Admitted) -> FileResponse:
    """Returns a copy of the database, read back, and notes who has made it. The copy goes when it was sent.

    Raises:
        StoreError: It is no SQLite database, or there is no room.
    """
    folder = tempfile.TemporaryDirectory(prefix="prefstudy-backup-")
    name = f"prefstudy-{datetime.now(UTC):%Y-%m-%dT%H%M%SZ}.db"
    try:
        contents = back_up(parts.database, Path(folder.name) / name)
    except BaseException:
        folder.cleanup()
        raise
    detail = {"n_sessions": contents.n_sessions, "n_events": contents.n_events}
    parts.runtime.store.desk.record(here.name, "backed_up", None, detail)
    path = Path(folder.name) / name
    return FileResponse(path, media_type=SQLITE, filename=name, background=BackgroundTask(folder.cleanup))
