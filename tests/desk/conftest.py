"""A laboratory for all tests that leave it as it is, and new ones for the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from app import wiring
from app.services.desk_accounts import DeskAccounts
from app.settings import find_study
from study_core.study import parse_study
from tests.desk.laboratory import Laboratory
from tests.web.conftest import serving

Opener = Callable[..., AbstractContextManager[Laboratory]]


@contextmanager
def laboratory(folder: Path, sections: str = "", study: str = "quickstart") -> Iterator[Laboratory]:
    """Opens a laboratory whose study has these sections besides, and in which nobody is yet."""
    database = f"sqlite:///{folder / 'desk.db'}"
    definition = parse_study(find_study(study).text + sections)
    settings = wiring.ServeSettings(definition, database, "127.0.0.1", 0, 1, None, None)
    with wiring.headless(database) as runtime:
        accounts = DeskAccounts(runtime.store)
        parts = wiring._parts(settings, runtime, accounts)
        for arm in definition.arms:
            runtime.open_study(arm)
        with serving(parts) as url:
            yield Laboratory(url, parts, accounts, folder / "desk.db")


@pytest.fixture
def opened(tmp_path: Path) -> Opener:
    """Opens a laboratory of the test's own."""

    @contextmanager
    def open_it(sections: str = "", study: str = "quickstart") -> Iterator[Laboratory]:
        with laboratory(tmp_path, sections, study) as found:
            found.people_the_desk()
            yield found

    return open_it


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Laboratory]:
    """A laboratory that nobody has yet."""
    with laboratory(tmp_path) as found:
        yield found


@pytest.fixture(scope="session")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Laboratory]:
    """A laboratory with experimenters of all roles and no participants yet."""
    with laboratory(tmp_path_factory.mktemp("desk")) as found:
        found.people_the_desk()
        yield found


@pytest.fixture(scope="session")
def person(lab: Laboratory) -> str:
    """The session of somebody who has completed the study, with A throughout."""
    return lab.completed()
