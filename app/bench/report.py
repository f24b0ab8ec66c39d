"""What every measurement tells: numbers in a few figures, and the machine and versions they were taken with."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import AppError

_PACKAGES = (
    "prefstudy",
    "numpy",
    "scipy",
    "numba",
    "distributed",
    "fastapi",
    "uvicorn",
    "viser",
    "sqlalchemy",
)


class BenchError(AppError):
    """A measurement that can't be taken."""


def spread(values: Sequence[float]) -> dict[str, float]:
    """Returns the median and the range that holds the middle four fifths."""
    p10, median, p90 = np.percentile(values, [10, 50, 90])
    return {"median": figures(median), "p10": figures(p10), "p90": figures(p90)}


def percentile(values: Sequence[float], level: float) -> float:
    """Returns a percentile, e.g. the 99th."""
    return figures(np.percentile(values, level))


def provenance(seed: int) -> dict[str, Any]:
    """Returns where and with what a measurement was taken."""
    return {
        "versions": {"python": platform.python_version()} | {name: version(name) for name in _PACKAGES},
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "cpu": _cpu_name(),
        "seed": seed,
    }


def figures(value: float | np.floating[Any]) -> float:
    """Rounds to what a stopwatch can tell."""
    return float(f"{float(value):.4g}")


def _cpu_name() -> str:
    description = Path("/proc/cpuinfo")
    if description.exists():
        for line in description.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
