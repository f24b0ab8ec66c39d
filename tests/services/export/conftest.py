"""One database with a bit of everything, and its exports in every form."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from app.services.export import Export, ExportOptions, export, open_export
from app.services.export.layout import FORMS
from app.store import open_store
from tests.services.export.people import let_everybody_in


@pytest.fixture(scope="session")
def database(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A database with seven people; see `people`."""
    url = f"sqlite:///{tmp_path_factory.mktemp('export') / 'study.db'}"
    let_everybody_in(url)
    return url


@pytest.fixture(scope="session")
def exports(database: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Export]:
    """Everybody, with all samples, in every form."""
    folder = tmp_path_factory.mktemp("exports")
    with open_store(database) as store:
        for form in FORMS:
            assert export(store, folder / form, ExportOptions(form, "all", samples="all")) == 7
    return {form: open_export(folder / form) for form in FORMS}


@pytest.fixture
def copied(exports: dict[str, Export], tmp_path: Path) -> Callable[[str], Export]:
    """Gives an export that may be changed."""

    def copy(form: str) -> Export:
        shutil.copytree(exports[form].folder, tmp_path / form)
        return open_export(tmp_path / form)

    return copy
