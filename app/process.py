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


def _kernels_digest() -> str:
    # Compiled code holds the constants that it imports, and domains keep theirs beside their kernels.
    core = Path(__file__).resolve().parent.parent / "study_core"
    digest = hashlib.sha256(sys.version.encode())
    for path in sorted({*core.rglob("*kernels.py"), *(core / "domains").rglob("*.py")}):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_directory() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "prefstudy" / "kernels" / _kernels_digest()


for _library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"
os.environ.setdefault("NUMBA_CACHE_DIR", str(_cache_directory()))


def n_cores() -> int:
    """Returns how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
