"""What a user is told who would learn from nobody, or from people who have hardly answered: one line, and no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.services.published import import_person, read_people
from app.store import open_store
from tests.support.command_line import assert_one_line_with, run
from tests.support.published import write_person


def database_of_one_person(folder: Path, n_active: int) -> str:
    write_person(folder, 1, n_active=n_active, n_test=4)
    url = f"sqlite:///{folder / 'people.db'}"
    with open_store(url) as store:
        for person in read_people(folder, lambda done, total: None):
            import_person(store, person)
    return url


@pytest.fixture
def few(tmp_path: Path) -> str:
    """A database of somebody who has answered one query less than is needed."""
    return database_of_one_person(tmp_path, n_active=9)


@pytest.fixture
def empty(tmp_path: Path) -> str:
    url = f"sqlite:///{tmp_path / 'empty.db'}"
    open_store(url).close()
    return url


@pytest.mark.parametrize(
    ("database", "said"),
    [
        ("empty", "Error: Nobody here can be evaluated. Import or finish some sessions first."),
        (
            "few",
            "Error: Nobody here can be evaluated. Person 1 has 9 active answers that prefer a side; 14 are needed. "
            "Import or finish some sessions first.",
        ),
    ],
)
def test_nobody_to_evaluate_or_report_is_one_line(
    request: pytest.FixtureRequest, tmp_path: Path, database: str, said: str
) -> None:
    url, out = request.getfixturevalue(database), tmp_path / "report.html"
    for command in (["evaluate"], ["report", str(out)]):
        done = run(*command, "--database", url)
        assert (done.returncode, done.stdout, done.stderr) == (1, "", f"{said}\n")
    assert not out.exists()


@pytest.mark.parametrize("database", ["empty", "few"])
def test_nobody_to_train_on_is_no_failure_because_nothing_is_missing(
    request: pytest.FixtureRequest, database: str
) -> None:
    url = request.getfixturevalue(database)
    done = run("train", "--workers", "1", "--database", url)
    assert (done.returncode, done.stdout) == (0, "Nobody with enough answers lacks a model.\n")


def test_a_single_person_cannot_be_taken_for_new(tmp_path: Path) -> None:
    url = database_of_one_person(tmp_path, n_active=14)
    assert_one_line_with(run("evaluate", "--new-person", "--database", url), "at least 2 people")


@pytest.mark.parametrize(
    "command",
    [["evaluate"], ["report", "out.html"], ["train"], ["export", "out"], ["delete", "one", "--yes"]],
)
def test_a_mistyped_database_is_named_and_not_made(command: list[str], tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'mistyped.db'}"
    done = run(*command, "--database", url)
    assert_one_line_with(done, "found none. Name the one that your people are in, with --database")
    assert list(tmp_path.iterdir()) == []
