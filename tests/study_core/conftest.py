"""The published study's data, if it is there."""

import os
from pathlib import Path

import pytest

from study_core.published import PublishedPerson, read_study

VARIABLE = "PREFSTUDY_PUBLISHED_DATA"


@pytest.fixture(scope="session")
def published_directory() -> Path:
    """The folder that the environment names, or one beside the repository."""
    beside = Path(__file__).parents[2].parent / "shared" / "data" / "katz2021"
    directory = Path(os.environ.get(VARIABLE, beside))
    if not directory.is_dir():
        pytest.skip(f"The published data is not here: set {VARIABLE} to the folder of its JLD2 files.")
    return directory


@pytest.fixture(scope="session")
def published_study(published_directory: Path) -> dict[int, PublishedPerson]:
    """Everyone whose files are there."""
    return read_study(published_directory)
