"""A session's screens, sent as they change: server-sent events on one response."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import asdict

from starlette.concurrency import run_in_threadpool

from app.services import study as services
from app.services.runtime import Runtime
from app.store import SessionDeletedError
from app.web.changes import Changes

_LONGEST_SILENCE_S = 15.0


async def screen_events(
    runtime: Runtime, session_id: str, changes: Changes, n_viewers: Callable[[str], int]
) -> AsyncIterator[str]:
    """Yields the screen at once, after each change and, so that a dead connection is noticed, every 15 seconds.

    Ends after the screen that says that the session is finished, when it is deleted, and when the server ends.

    Args:
        runtime: The services' resources.
        session_id: Whose screens.
        changes: Wakes this.
        n_viewers: Tells how many browser pages watch a session's stage.
    """
    changed = changes.listen(session_id)
    try:
        while not changes.is_closing:
            # Before reading, so that a change after it is noticed.
            changed.clear()
            try:
                screen = await run_in_threadpool(services.screen, runtime, session_id)
            except SessionDeletedError:
                return
            yield f"data: {json.dumps({**asdict(screen), 'stage_viewers': n_viewers(session_id)})}\n\n"
            if screen.kind == "finished":
                return
            with suppress(TimeoutError):
                async with asyncio.timeout(_LONGEST_SILENCE_S):
                    await changed.wait()
    finally:
        changes.forget(session_id, changed)
