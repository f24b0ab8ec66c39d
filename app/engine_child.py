"""Preloaded by every process of the engine: it dies with its parent, and a worker is warm before it takes work."""

from __future__ import annotations

import os
import sys
import threading
from typing import Any


def dask_setup(server: Any) -> None:
    """Runs once, before the scheduler or worker is open for work."""
    threading.Thread(target=_exit_with_parent, name="exit-with-parent", daemon=True).start()
    if type(server).__name__ == "Worker":
        _give_way()
        _compile_kernels()


def _give_way() -> None:
    """Runs this process only on what the others leave: serving people comes before computing ahead for them.

    Niceness alone isn't enough on Linux: a woken thread of the server waits for the end of a nice worker's time slice,
    some milliseconds, each of the many times that it changes hands with the server's other threads.
    """
    if hasattr(os, "SCHED_IDLE"):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    else:
        os.nice(19)


def _exit_with_parent() -> None:
    """Waits for the end of standard input, which the parent holds open: it comes even if the parent is killed."""
    sys.stdin.buffer.read()
    os._exit(1)


def _compile_kernels() -> None:
    from app.continuation import warm_up  # after giving way: the first import compiles
    from app.settings import study_text_named

    warm_up(study_text_named("quickstart"))
