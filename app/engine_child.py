"""Preloaded by every process of the engine: it dies with its parent, and a worker is warm before it takes work."""

from __future__ import annotations

import os
import sys
import threading
from typing import Any

# Serving people comes before computing ahead for them.
_WORKER_NICENESS = 10


def dask_setup(server: Any) -> None:
    """Runs once, before the scheduler or worker is open for work."""
    threading.Thread(target=_exit_with_parent, name="exit-with-parent", daemon=True).start()
    if type(server).__name__ == "Worker":
        os.nice(_WORKER_NICENESS)
        _compile_kernels()


def _exit_with_parent() -> None:
    """Waits for the end of standard input, which the parent holds open: it comes even if the parent is killed."""
    sys.stdin.buffer.read()
    os._exit(1)


def _compile_kernels() -> None:
    from app.continuation import warm_up  # after the niceness: the first import compiles
    from app.settings import study_text_named

    warm_up(study_text_named("quickstart"))
