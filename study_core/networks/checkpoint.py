"""Trained networks as bytes: safetensors, which holds numbers and text and can't hold code.

The metadata has one entry, in JSON with sorted keys, so that equal networks are equal bytes. It holds the digest of
everything else: a byte that has changed is found.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from study_core.errors import CheckpointError, NetworkError
from study_core.networks.config import NetworkConfig
from study_core.networks.model import Networks

FORMAT = "prefstudy-networks-1"
_KEY = "prefstudy"
_LENGTH_BYTES = 8


@dataclass(frozen=True)
class Lineage:
    """Where networks come from.

    Attributes:
        answers_digest: SHA-256 of the answers that they were trained on, in hex.
        config_digest: `NetworkConfig.digest` of how they were trained.
        domain_id: The domain whose trajectories were compared.
        versions: Of the code: the package's and the training's, `training.VERSION`.
        seed: Names the random streams of the training.
    """

    answers_digest: str
    config_digest: str
    domain_id: str
    versions: tuple[str, ...]
    seed: int


@dataclass(frozen=True)
class Checkpoint:
    """Trained networks, how they were trained, and on what.

    Attributes:
        networks: Their numbers.
        config: How they were trained.
        lineage: On what, by which code.
    """

    networks: Networks
    config: NetworkConfig
    lineage: Lineage


def to_bytes(checkpoint: Checkpoint) -> bytes:
    """Returns a checkpoint as bytes, the same for equal checkpoints."""
    tensors = {
        field.name: np.ascontiguousarray(getattr(checkpoint.networks, field.name))
        for field in fields(Networks)
    }
    story = {
        "format": FORMAT,
        "config": checkpoint.config.to_json(),
        "lineage": asdict(checkpoint.lineage),
    }
    sealed = {"digest": _digest(story, tensors), "story": story}
    return save(tensors, {_KEY: json.dumps(sealed, sort_keys=True)})


def from_bytes(data: bytes) -> Checkpoint:
    """Returns what `to_bytes` wrote.

    Raises:
        CheckpointError: The bytes are damaged, or something else's.
    """
    try:
        tensors = load(data)
        sealed = json.loads(_metadata(data)[_KEY])
        story = sealed["story"]
        if story["format"] != FORMAT or sealed["digest"] != _digest(story, tensors):
            raise ValueError(f"a file of {story['format']} whose contents don't match their digest")
        lineage = Lineage(**story["lineage"] | {"versions": tuple(story["lineage"]["versions"])})
        return Checkpoint(Networks(**tensors), NetworkConfig.from_json(story["config"]), lineage)
    # A key that is missing, a value of another type, text that isn't JSON: all say that it isn't ours.
    except (SafetensorError, NetworkError, LookupError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise CheckpointError(
            f"Expected the bytes of a {FORMAT} checkpoint, got {len(data)} others ({reason}). Train again."
        ) from error


def _metadata(data: bytes) -> dict[str, str]:
    """Returns the file's own metadata: after eight bytes that say its length comes a header in JSON."""
    end = _LENGTH_BYTES + int.from_bytes(data[:_LENGTH_BYTES], "little")
    metadata: dict[str, str] = json.loads(data[_LENGTH_BYTES:end])["__metadata__"]
    return metadata


def _digest(story: dict[str, Any], tensors: dict[str, np.ndarray]) -> str:
    """Returns the SHA-256 of everything that is kept, in hex."""
    digest = hashlib.sha256(json.dumps(story, sort_keys=True).encode())
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tensors[name].shape}".encode())
        digest.update(tensors[name].tobytes())
    return digest.hexdigest()
