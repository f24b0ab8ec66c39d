"""The web application: its routes, its error pages and its guard, put together."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool

from app.services.joining import Door
from app.settings import STATIC
from app.web.errors import add_error_pages
from app.web.guard import Guard
from app.web.joining import join_routes
from app.web.leaving import leaving_routes
from app.web.participant import participant_routes
from app.web.parts import SiteParts
from app.web.steps import step_routes
from app.web.trial import trial_routes


def create_site(parts: SiteParts) -> FastAPI:
    """Returns the application, ready to be served."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        parts.changes.start()
        yield
        await run_in_threadpool(parts.on_shutdown)

    site = FastAPI(title="prefstudy", lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)
    site.state.parts = parts
    site.add_middleware(Guard, public_url=parts.public_url)
    site.mount("/static", StaticFiles(directory=STATIC), name="static")
    add_error_pages(site)

    @site.get("/healthz")
    def health() -> dict[str, str]:
        return {"status": "ok", "study": parts.study.name}

    door = Door(parts.runtime, parts.study)
    site.include_router(join_routes(parts, door))
    site.include_router(leaving_routes(parts, door))
    site.include_router(participant_routes(parts))
    site.include_router(step_routes(parts))
    site.include_router(trial_routes(parts))
    site.include_router(parts.stage)
    for path, application in parts.mounts.items():
        site.mount(path, application)
    return site
