"""Who a request is of: the secret in its address."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, HTTPException, Request
from starlette.concurrency import run_in_threadpool

from app.services import study as services
from app.services.runtime import Runtime
from app.store import SessionRecord
from app.web.languages import N_

UNKNOWN_LINK = (
    N_("This link doesn’t open a session here"),
    N_(
        "Check that the whole link was copied, or ask the person who sent it to you for a new one.\n\n"
        "If you have deleted your answers, this link went with them: nothing is left for it to open."
    ),
)


async def _session_of(request: Request, token: str) -> SessionRecord:
    runtime: Runtime = request.app.state.parts.runtime
    # Almost every request is of a session that is known; only the first has to ask the store, in a thread.
    found = services.find_known(runtime, token) or await run_in_threadpool(services.find, runtime, token)
    if found is None:
        raise HTTPException(404, UNKNOWN_LINK)
    return found


ThisSession = Annotated[SessionRecord, Depends(_session_of)]
"""The session that the secret in a request's address opens; whoever has none is told so."""
