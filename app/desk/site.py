"""The desk as an application of its own, below `/desk` of the site."""

from __future__ import annotations

from fastapi import Depends, FastAPI

from app.desk.accounts import account_routes
from app.desk.admission import admit
from app.desk.backups import backup_routes
from app.desk.conditions import ConditionLooks
from app.desk.errors import add_desk_errors
from app.desk.login import login_routes
from app.desk.parts import DeskParts
from app.desk.people import people_routes
from app.desk.reports import report_routes
from app.desk.studies import study_routes


def create_desk(parts: DeskParts) -> FastAPI:
    """Returns the desk's pages."""
    desk = FastAPI(
        title="prefstudy desk",
        dependencies=[Depends(admit)],
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    desk.state.parts = parts
    add_desk_errors(desk)
    looks = ConditionLooks(parts.runtime.store)
    desk.include_router(login_routes(parts))
    desk.include_router(study_routes(parts, looks))
    desk.include_router(report_routes(parts))
    desk.include_router(backup_routes(parts))
    desk.include_router(people_routes(parts, looks))
    desk.include_router(account_routes(parts))
    return desk
