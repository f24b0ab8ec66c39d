"""The bank of a domain: every distinct local optimum that single climbs find, for weights all around.

It is the pool of realistic drives, since each is locally the best for someone, and it is where the search for the best
drive of any w starts. Random starts climb under random weights, uniform on the nonnegative sphere; of drives that look
the same, the first is kept. Poor local optima stay: their variety is what informative queries are made of.

A bank is a pure function of its recipe. It is built once and kept in the user's cache folder, in a file that
is named by the recipe and begins with the SHA-256 of the rest: a damaged file is built again, never trusted.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np
from jaxtyping import Float

from study_core import lbfgs
from study_core.distinctness import distinct_rows, visible_paths
from study_core.domain import Domain
from study_core.errors import BankError
from study_core.posterior.prior import Prior
from study_core.streams import stream

VERSION = "bank-1"

N_CLIMBS = 3000
_SEED = 0

# In body lengths: a few pixels of a picture that fills the screen. Nobody can tell such drives apart.
_LEAST_DIFFERENCE = 0.01

_CLIMBS_PER_BATCH = 250
_PROBES = 4
_DIGEST_SIZE = hashlib.sha256().digest_size

OnProgress = Callable[[int, int], None]
"""Called with the climbs done and the climbs in all."""

_log = logging.getLogger(__name__)
_open_banks: dict[str, Bank] = {}
_opening = Lock()


@dataclass(frozen=True)
class Bank:
    """Local optima of one domain; no two look the same. The arrays can't be written to.

    Attributes:
        domain_id: The domain whose drives they are.
        digest: SHA-256 of recipe and contents, in hex.
        controls: Of each drive, shape `(n_drives, n_controls)`.
        features: Phi of each drive, shape `(n_drives, n_features)`.
        weights: The w that each drive is locally the best for, shape `(n_drives, n_features)`.
        paths: What a viewer sees of each drive: see `distinctness.visible_paths`.
    """

    domain_id: str
    digest: str
    controls: Float[np.ndarray, "n_drives n_controls"]
    features: Float[np.ndarray, "n_drives n_features"]
    weights: Float[np.ndarray, "n_drives n_features"]
    paths: Float[np.ndarray, "n_drives n_bodies n_coordinates"]


def open_bank(domain: Domain, on_progress: OnProgress = lambda done, total: None) -> Bank:
    """Returns the domain's bank: from memory, from the cache folder, or built and kept there.

    Any number of threads and processes may open it at once. A cache that can't be written is a logged warning.

    Args:
        domain: Any plug-in.
        on_progress: Called only when the bank must be built, which takes seconds.

    Raises:
        BankError: No climb ends at an optimum.
    """
    with _opening:
        if domain.id not in _open_banks:
            recipe = _recipe(domain, N_CLIMBS)
            path = _cache_folder() / f"{domain.id}-{recipe[:16]}.bank"
            bank = _read(path, domain.id, recipe)
            if bank is None:
                bank = build_bank(domain, N_CLIMBS, on_progress)
                _write(path, recipe, bank)
            _open_banks[domain.id] = bank
        return _open_banks[domain.id]


def build_bank(
    domain: Domain, n_climbs: int = N_CLIMBS, on_progress: OnProgress = lambda done, total: None
) -> Bank:
    """Returns the bank of that many climbs; always the same.

    Raises:
        BankError: No climb ends at an optimum.
    """
    names = ("bank", domain.id)
    weights = Prior("sphere", len(domain.feature_names)).draw(stream(_SEED, *names, "weights"), n_climbs)
    starts = stream(_SEED, *names, "starts").uniform(
        domain.control_lower, domain.control_upper, (n_climbs, len(domain.control_lower))
    )
    controls, has_converged = np.empty_like(starts), np.zeros(n_climbs, dtype=bool)
    for first in range(0, n_climbs, _CLIMBS_PER_BATCH):
        batch = slice(first, first + _CLIMBS_PER_BATCH)
        controls[batch], _, has_converged[batch], _ = lbfgs.maximise(domain, starts[batch], weights[batch])
        on_progress(min(batch.stop, n_climbs), n_climbs)
    if not has_converged.any():
        raise BankError(
            f"Expected climbs in '{domain.id}' to end at local optima, got none of {n_climbs}: run check_domain on it."
        )
    controls, weights = controls[has_converged], weights[has_converged]
    paths = visible_paths(domain, controls)
    rows = distinct_rows(paths, _LEAST_DIFFERENCE)
    controls, weights, paths = controls[rows], weights[rows], paths[rows]
    features = domain.features(domain.rollout(controls))
    return _bank(domain.id, _recipe(domain, n_climbs), (controls, features, weights, paths))


def _bank(domain_id: str, recipe: str, arrays: tuple[np.ndarray, ...]) -> Bank:
    for array in arrays:
        array.setflags(write=False)
    return Bank(domain_id, _digest(recipe, _packed(arrays)).hex(), *arrays)


def _recipe(domain: Domain, n_climbs: int) -> str:
    """Returns the SHA-256 of all that a bank depends on, in hex.

    What the domain does on a few drives belongs to it: a plug-in whose numbers change while its id doesn't, or a
    machine that rounds differently, gets a bank of its own.
    """
    lower, upper = domain.control_lower, domain.control_upper
    controls = stream(_SEED, "bank", domain.id, "probes").uniform(lower, upper, (_PROBES, len(lower)))
    features = domain.features(domain.rollout(controls))
    rewards, gradients = domain.reward_and_gradient(controls, np.ones_like(features))
    names = (domain.id, VERSION, lbfgs.VERSION, _SEED, n_climbs, _LEAST_DIFFERENCE)
    probes = (lower, upper, features, rewards, gradients, visible_paths(domain, controls))
    return _digest(repr(names), _packed(probes)).hex()


def _packed(arrays: tuple[np.ndarray, ...]) -> bytes:
    """Returns the arrays in NumPy's own format, one after the other."""
    file = io.BytesIO()
    for array in arrays:
        np.save(file, array, allow_pickle=False)
    return file.getvalue()


def _digest(recipe: str, packed: bytes) -> bytes:
    return hashlib.sha256(recipe.encode() + packed).digest()


def _read(path: Path, domain_id: str, recipe: str) -> Bank | None:
    """Returns the bank in a file; None if there is none, or not the one that was written."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, packed = content[:_DIGEST_SIZE], content[_DIGEST_SIZE:]
    if digest != _digest(recipe, packed):
        return None
    file = io.BytesIO(packed)
    controls, features, weights, paths = (np.load(file, allow_pickle=False) for _ in range(4))
    return _bank(domain_id, recipe, (controls, features, weights, paths))


def _write(path: Path, recipe: str, bank: Bank) -> None:
    """Puts a complete file in place, whoever else is writing or reading it."""
    packed = _packed((bank.controls, bank.features, bank.weights, bank.paths))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            part = Path(folder) / path.name
            part.write_bytes(_digest(recipe, packed) + packed)
            part.replace(path)
    except OSError as error:
        _log.warning("Can't keep the bank in %s: %s. Every process will build its own.", path, error)


def _cache_folder() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "prefstudy" / "banks"
