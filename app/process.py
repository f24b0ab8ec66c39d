"""What every process of ours sets before numpy is imported; import this module first.

One thread for each numerical library: results are bit-for-bit the same, and processes don't fight over cores. And
one cache of compiled kernels for each state of their source: numba's own check looks at one file at a time, so a
kernel that calls one in another file would otherwise be served stale.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent


def _kernels_digest() -> str:
    digest = hashlib.sha256(sys.version.encode())
    for path in sorted((_ROOT / "study_core").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_directory() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "prefstudy" / "kernels" / _kernels_digest()


for _library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"
os.environ.setdefault("NUMBA_CACHE_DIR", str(_cache_directory()))
