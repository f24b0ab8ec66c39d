"""What stands on a stage, and waiting for it."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from app.stage.clip import LEVEL_Z
from app.stage.stage import Stage


def wait_until(condition: Callable[[], bool], at_most_s: float = 5.0) -> None:
    deadline = time.monotonic() + at_most_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def clips(stage: Stage) -> list[bytes]:
    """Clips on a stage, from the farthest to the nearest, which hides the others."""
    # The lock makes what is read here one moment, as the message batch does in the browser.
    with stage._lock:
        handles = dict(stage._server.scene._handle_from_node_name).values()
        found = sorted(
            (handle.position[2], handle.glb_data) for handle in handles if hasattr(handle, "glb_data")
        )
    assert [z for z, _ in found] == pytest.approx([LEVEL_Z * level for level in range(len(found))])
    return [data for _, data in found]
