"""The appendix reports what simulated people of known conduct did."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from app import wiring
from app.report.appendix.statistics import counts, moments, share, spread
from app.services.rehearsal import rehearse_all
from app.services.rehearsed_person import Crowd, Manners
from app.settings import find_study
from app.store import Review, Verdict, open_store
from study_core.study import parse_study
from tests.support.command_line import assert_one_line_with, run

STUDY = parse_study(
    find_study("full-path").text
    + """
[payment]
amount = 3.0
currency = "EUR"

[exclusion]
least_median_response_ms = 1000

[[condition]]
name = "gain"
acquisition.method = "information-gain"

[[condition]]
name = "random"
acquisition.method = "random"
"""
)


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> str:
    url = f"sqlite:///{tmp_path_factory.mktemp('appendix') / 's.db'}"
    with wiring.headless(url) as runtime:
        for seed, manners in (
            (1, Manners()),
            (2, Manners(declining=1.0)),
            (3, Manners(leaving=1.0)),
            (4, Manners(careless=1.0)),
        ):
            list(rehearse_all(runtime, STUDY, Crowd(seed, 3, manners=manners), 1, lambda: None))
    return url


@pytest.fixture(scope="module")
def tables(database: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[str]]]:
    """By title and first cell, the other cells of each row."""
    out = tmp_path_factory.mktemp("out") / "a.md"
    done = run("appendix", str(out), "--study", "full-path", "--people", "rehearsed", "--database", database)
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, list[str]]] = {}
    for section in re.split(r"^## ", out.read_text(), flags=re.MULTILINE)[1:]:
        title, *lines = section.splitlines()
        rows = [
            [cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines if line.startswith("|")
        ]
        found[title] = {row[0]: row[1:] for row in rows[2:]}
    return found


def test_everybody_who_began_is_accounted_for(tables: dict[str, dict[str, list[str]]], database: str) -> None:
    flow = {name: int(cells[0]) for name, cells in tables["Flow of participants"].items()}
    lost = sum(
        n
        for name, n in flow.items()
        if name not in ("began", "completed", "analysed") and not name.startswith("of these")
    )
    assert flow["began"] == 12 == lost + flow["completed"]
    assert (flow["declined consent"], flow["stopped"]) == (3, 3)
    excluded = flow.get("of these excluded", 0)
    assert flow["analysed"] == flow["completed"] - excluded
    # Careless people fail the comprehension check, or are excluded for their haste.
    assert flow.get("failed the comprehension check", 0) + excluded == 3


def test_conditions_add_up(tables: dict[str, dict[str, list[str]]]) -> None:
    rows = tables["Conditions"]
    assert list(rows) == ["gain", "random"]
    assert sum(int(cells[0]) for cells in rows.values()) == 12
    assert sum(int(cells[2]) for cells in rows.values()) == int(tables["Flow of participants"]["analysed"][0])


def test_what_people_filled_in_and_are_paid_is_there(tables: dict[str, dict[str, list[str]]]) -> None:
    n_analysed = int(tables["Flow of participants"]["analysed"][0])
    assert tables["Questionnaire: comprehension"]["which-car"][1] == f"blue {n_analysed}"
    assert tables["Questionnaire: demographics"]["country"][1] == f"{n_analysed} wrote something"
    genders = re.findall(r" (\d+)", " " + tables["Questionnaire: demographics"]["gender"][1])
    assert sum(map(int, genders)) == n_analysed
    completed = int(tables["Flow of participants"]["completed"][0])
    assert tables["Payment"]["altogether"] == [f"{3 * completed:.2f} EUR"]
    assert STUDY.version in str(tables["Procedure and software"])


def test_somebody_excluded_later_is_named_with_the_reason(database: str, tmp_path: Path) -> None:
    with open_store(database) as store:
        line = next(line for line in store.person_lines("full-path") if line.ending == "completed")
        store.desk.put_review(
            line.session.id, Review(Verdict.EXCLUDED, "fell | asleep", "", line.review.revision), "ann"
        )
    run(
        "appendix",
        str(tmp_path / "b.md"),
        "--study",
        "full-path",
        "--people",
        "rehearsed",
        "--database",
        database,
    )
    assert "| excluded | fell \\| asleep | ann | 1 |" in (tmp_path / "b.md").read_text()


def test_a_study_without_people_has_no_appendix(database: str, tmp_path: Path) -> None:
    done = run("appendix", str(tmp_path / "c.md"), "--study", "full-path", "--database", database)
    assert_one_line_with(done, "found nobody")
    assert not (tmp_path / "c.md").exists()


def test_numbers_are_written_as_papers_do() -> None:
    assert spread([1.0, 2.0, 3.0, 4.0, 5.0], " s") == "3 s (2 to 4)"
    assert spread([7.25]) == "7.25 (7.25 to 7.25)"
    assert spread([]) == moments([]) == counts([]) == share(0, 0) == "none"
    assert moments([1, 2, 3]) == "M 2, SD 1, range 1 to 3"
    assert counts(["b", "a", "a"]) == "a 2, b 1"
    assert share(1, 4) == "1 of 4 (25 %)"
