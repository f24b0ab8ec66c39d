"""Named random streams from one study seed; nothing in the product uses a global generator.

A stream depends on its names alone, so query 37 is derived again without drawing queries 1 to 36.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Returns the generator of that name, e.g. `stream(7, "posterior", participant, query_index)`.

    Args:
        seed: The study's seed, non-negative.
        names: What the stream is for; strings and integers, in order.
    """
    digest = hashlib.sha256("\x1f".join(f"{type(n).__name__}:{n}" for n in names).encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
