"""What every measurement tells: numbers in a few figures, and the machine and versions they were taken with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import AppError
from app.machine import cpu_model
from app.process import n_cores
from app.versions import versions_of

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


def make_folder(path: Path) -> None:
    """Makes the folder that pictures go to.

    Raises:
        BenchError: It exists, or can't be made.
    """
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise BenchError(f"Can't make the folder {path}: {error.strerror}. Name a new one.") from error


def provenance(seed: int, packages: Sequence[str] = ()) -> dict[str, Any]:
    """Returns where and with what a measurement was taken; `packages` had a part in it beside the usual ones."""
    return {
        "versions": versions_of([*_PACKAGES, *packages]),
        "cores": n_cores(),
        "cpu": cpu_model(),
        "seed": seed,
    }


def figures(value: float | np.floating[Any]) -> float:
    """Rounds to what a stopwatch can tell."""
    return float(f"{float(value):.4g}")
