"""Writes binary glTF 2.0 (GLB): one JSON chunk, one chunk of numbers. Pure, deterministic."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from jaxtyping import Float

_FLOAT = 5126
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class GlbWriter:
    """Collects numbers and the JSON that describes them; `finish` joins both."""

    def __init__(self) -> None:
        """Starts an empty file."""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }
        self._chunks: list[bytes] = []
        self._length = 0

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Appends to one of the document's lists and returns the entry's index."""
        entries: list[dict[str, Any]] = self.document[kind]
        entries.append(entry)
        return len(entries) - 1

    def accessor(self, packed: Packed) -> int:
        """Stores an array and returns the index of its accessor."""
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": len(packed.data)}
        self._chunks.append(packed.data)
        self._length += len(packed.data)
        return self.add("accessors", {"bufferView": self.add("bufferViews", view), **packed.description})

    def unlit(self, red: float, green: float, blue: float, alpha: float = 1.0) -> int:
        """Adds a material that ignores lights and returns its index."""
        material: dict[str, Any] = {
            "pbrMetallicRoughness": {
                "baseColorFactor": [red, green, blue, alpha],
                "metallicFactor": 0,
                "roughnessFactor": 0.8,
            },
            "extensions": {"KHR_materials_unlit": {}},
        }
        if alpha < 1.0:
            material["alphaMode"] = "BLEND"
        return self.add("materials", material)

    def finish(self) -> bytes:
        """Returns the file."""
        self.document["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self.document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        numbers = b"".join(self._chunks)
        total = 12 + 8 + len(text) + 8 + len(numbers)
        return b"".join(
            (
                struct.pack("<4sII", b"glTF", 2, total),
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(numbers), b"BIN\0"),
                numbers,
            )
        )


class Packed:
    """An array as glTF stores it: 32-bit floats, with the description of its accessor."""

    __slots__ = ("data", "description")

    def __init__(self, values: Float[np.ndarray, "n ..."], bounded: bool = False) -> None:
        """Packs an array.

        Args:
            values: Shape `(n,)`, `(n, 3)` or `(n, 4)`.
            bounded: Whether glTF demands the least and greatest values (positions, key times).
        """
        array = np.ascontiguousarray(values, dtype="<f4")
        flat = array.reshape(len(array), -1)
        self.data: bytes = array.tobytes()
        self.description: dict[str, Any] = {
            "componentType": _FLOAT,
            "count": len(array),
            "type": _TYPES[flat.shape[1]],
        }
        if bounded:
            self.description["min"] = flat.min(axis=0).tolist()
            self.description["max"] = flat.max(axis=0).tolist()
