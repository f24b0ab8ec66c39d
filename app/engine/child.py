"""Preloaded by every process of the engine: it dies with its parent, and a worker lets the web server go first."""

from __future__ import annotations

import os
import sys
import threading
from typing import Any

# Serving people comes before computing ahead for them, and both before what nobody waits for.
_WORKER_NICENESS = 10
_TRAINING_NICENESS = 19


def dask_setup(server: Any) -> None:
    """Runs once, before the scheduler or worker is open for work."""
    threading.Thread(target=_exit_with_parent, name="exit-with-parent", daemon=True).start()
    if type(server).__name__ == "Worker":
        os.nice(_WORKER_NICENESS if "query" in server.state.total_resources else _TRAINING_NICENESS)


def _exit_with_parent() -> None:
    """Waits for the end of standard input, which the parent holds open: it comes even if the parent is killed."""
    sys.stdin.buffer.read()
    os._exit(1)
