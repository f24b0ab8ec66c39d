"""`prefstudy replay` on an export, as a user types it: what it prints, and how it ends."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from app.settings import find_study
from tests.support.command_line import assert_one_line_with, run, run_apart
from tests.support.exports import edit, mend, rows, say_computed_elsewhere


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two rehearsed people with short sessions."""
    folder = tmp_path_factory.mktemp("reproducing")
    text = find_study("quickstart").text.replace("active_queries = 8 ", "active_queries = 3 ")
    (folder / "short.toml").write_text(text.replace("test_queries = 4 ", "test_queries = 2 "))
    walked = ("--people", "2", "--seed", "4", "--workers", "1", "--study", str(folder / "short.toml"))
    done = run("simulate", *walked, "--database", f"sqlite:///{folder / 's.db'}", "--json")
    assert done.returncode == 0, done.stderr
    return folder / "s.db"


def exported(database: Path, folder: Path, *options: str) -> str:
    done = run(
        *("export", str(folder), "--people", "rehearsed", "--database", f"sqlite:///{database}"), *options
    )
    assert done.returncode == 0, done.stderr
    return str(folder)


def people(printed: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in printed.splitlines()]


def test_it_says_who_was_reproduced_and_how(database: Path, tmp_path: Path) -> None:
    out = exported(database, tmp_path / "out", "--samples", "all")
    done = run("replay", out)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("5 stored queries reproduced to the last bit") == 2
    assert "2 people reproduced" in done.stdout
    done = run("replay", out, "--steps")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("each step of 5 stored queries verified alone") == 2


def test_its_json_is_the_same_in_every_process_and_of_every_export(database: Path, tmp_path: Path) -> None:
    first = exported(database, tmp_path / "first", "--format", "parquet")
    key = str(tmp_path / "key.csv")
    second = exported(database, tmp_path / "second", "--format", "csv", "--pseudonyms", key)
    done, apart = run("replay", first, "--json"), run_apart("replay", second, "--json")
    assert done.returncode == apart.returncode == 0, done.stderr + apart.stderr
    assert done.stdout == apart.stdout
    told = people(done.stdout)
    assert [each["participant"] for each in told] == ["rehearsal-4-1", "rehearsal-4-2"]
    assert {(each["way"], each["queries"]) for each in told} == {("derived", 5)}


def test_what_another_processor_computed_is_verified_and_said_so(database: Path, tmp_path: Path) -> None:
    elsewhere = Path(shutil.copy(database, tmp_path / "elsewhere.db"))
    say_computed_elsewhere(elsewhere)
    out = exported(elsewhere, tmp_path / "out", "--samples", "all")
    done = run("replay", out)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("verified alone") == 2
    assert "computed on aarch64, another (cortex-a72): neon; this is " in done.stdout
    told = people(run("replay", out, "--json").stdout)
    assert {each["way"] for each in told} == {"verified"}
    assert told[0]["other_machines"] == ["aarch64, another (cortex-a72): neon"]
    without = exported(elsewhere, tmp_path / "without")
    assert_one_line_with(run("replay", without), "Export again with --samples all")


def test_a_changed_number_ends_it_with_one_line_that_names_it(database: Path, tmp_path: Path) -> None:
    out = exported(database, tmp_path / "out", "--format", "jsonl")
    person = rows(tmp_path / "out", "people")[0]["person_id"]

    def change(table: list[dict[str, Any]]) -> None:
        table[1]["score"] += 1e-15

    edit(tmp_path / "out", "queries", change)
    done = run("replay", out)
    assert_one_line_with(done, "queries.jsonl, row 2", person, "query 1", "score is")
    assert "reproduced" not in done.stdout
    mend(tmp_path / "out")
    assert_one_line_with(run("replay", out), "table queries, query 1: score: stored", person)


def test_who_cannot_be_derived_is_named_and_the_others_are(database: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    exported(database, out, "--format", "jsonl")

    def gone(log: list[dict[str, Any]]) -> None:
        first = log[0]["person_id"]
        log[:] = [row for row in log if row["person_id"] != first or row["kind"] == "session_begun"]

    edit(out, "events", gone)
    mend(out)
    done = run("replay", str(out))
    assert done.returncode == 0, done.stderr
    assert "was asked nothing" in done.stderr
    assert done.stdout.count("stored queries reproduced") == 1


def test_a_folder_or_file_that_is_neither_is_one_line(tmp_path: Path) -> None:
    assert_one_line_with(run("replay", str(tmp_path)), "prefstudy export")
    assert_one_line_with(run("replay", str(tmp_path / "absent")), "folder of an export")
