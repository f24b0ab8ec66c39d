"""Arrays as bytes and JSON as text, both exact.

Arrays are float64, little-endian, in C order, so a database moves between machines. JSON is ASCII with
sorted keys: equal values have equal text. Floats are written in the shortest form that reads back to the same
bits; a value that isn't finite is written `NaN`, `Infinity` or `-Infinity`, as Python reads and writes them.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.store.errors import StoreError

_STORED = np.dtype("<f8")


def encode_floats(values: NDArray[np.float64]) -> bytes:
    """Writes an array of any shape as bytes; its shape is kept elsewhere."""
    return np.ascontiguousarray(values, dtype=_STORED).tobytes()


def decode_floats(content: bytes, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Reads what `encode_floats` wrote.

    Args:
        content: The bytes.
        shape: Shape of the array that was written.

    Returns:
        A new, writable array. (A read-only view would make numba compile its kernels a second time.)

    Raises:
        StoreError: When the bytes don't fill the shape.
    """
    if len(content) != math.prod(shape) * _STORED.itemsize:
        raise StoreError(
            f"Expected an array of shape {shape} in the database, got {len(content)} bytes: "
            "the row is damaged. Restore the database from a backup."
        )
    return np.frombuffer(content, dtype=_STORED).astype(np.float64).reshape(shape)


def encode_json(value: dict[str, Any]) -> str:
    """Writes a JSON object as text.

    Args:
        value: Keys are strings; values are JSON. Tuples come back as lists.

    Raises:
        StoreError: When something in it isn't JSON.
    """
    try:
        return json.dumps(value, sort_keys=True, separators=(",", ":"))
    except (TypeError, ValueError) as error:
        raise StoreError(
            f"Expected plain JSON values, got something else: {error}. "
            "Convert arrays and numpy integers to lists and int first."
        ) from error


def decode_json(text: str) -> dict[str, Any]:
    """Reads what `encode_json` wrote."""
    value: dict[str, Any] = json.loads(text)
    return value
