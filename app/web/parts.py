"""What the site is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fastapi import APIRouter
from starlette.types import ASGIApp

from app.services.runtime import Runtime
from app.web.changes import Changes
from study_core.study import Study


@dataclass(frozen=True)
class SiteParts:
    """What the site is made of.

    Attributes:
        runtime: The services' resources.
        stage: Routes of the participants' stages.
        n_viewers: Tells how many browser pages watch a session's stage.
        changes: Wakes the streams of screens.
        study: The study that people can join.
        public_url: Address that participants use, if it isn't the one the server listens on.
        mounts: Other applications of the site, by the path below which they are.
        on_shutdown: Called when the server has stopped accepting.
    """

    runtime: Runtime
    stage: APIRouter
    n_viewers: Callable[[str], int]
    changes: Changes
    study: Study
    public_url: str | None
    mounts: Mapping[str, ASGIApp]
    on_shutdown: Callable[[], None]
