"""What every test starts from: one thread, checked shapes, printed seeds, a store of its own."""

from __future__ import annotations

import sys

assert "numpy" not in sys.modules, "numpy must be imported after the thread settings"

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

import app.process  # noqa: F401  - before numpy: what every process of ours sets
from app.store import Store, open_store


def _check_shapes_in_the_core() -> None:
    """Makes beartype check every annotation of `study_core` while the tests run.

    The hook wraps every function of a module, below its other decorators, and numba can't compile a wrapped
    function. So compiled code lives only in modules whose name ends in `kernels`, and those are left alone.
    """
    assert "study_core" not in sys.modules, "study_core must be imported after the hook that checks it"
    hook = install_import_hook("study_core", "beartype.beartype").hook
    is_in_the_core = hook.should_instrument  # type: ignore[attr-defined]
    hook.should_instrument = lambda name: is_in_the_core(name) and not name.endswith("kernels")  # type: ignore[attr-defined]


_check_shapes_in_the_core()

# The same examples on every run and every machine; a failure prints how to repeat it.
settings.register_profile("prefstudy", derandomize=True, print_blob=True, deadline=None)
settings.load_profile("prefstudy")


@pytest.fixture
def database_url(tmp_path: Path) -> str:
    """The URL of a database that doesn't exist yet."""
    return f"sqlite:///{tmp_path / 'study.db'}"


@pytest.fixture
def store(database_url: str) -> Iterator[Store]:
    """An empty store."""
    with open_store(database_url) as opened:
        yield opened
