"""With what results were computed."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from importlib.metadata import version


def versions_of(packages: Iterable[str]) -> dict[str, str]:
    """Returns the version of Python, then those of packages, by name."""
    return {"python": platform.python_version()} | {name: version(name) for name in packages}
