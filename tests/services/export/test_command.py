"""The command `export`."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.services.export import open_export
from tests.support.command_line import assert_one_line_with, run


def test_all_that_can_be_wanted_can_be_told(database: str, tmp_path: Path) -> None:
    out, key = tmp_path / "out", tmp_path / "key.csv"
    wishes = "--format psych-ds --people rehearsed --study full-path --samples none --clips --keep-times"
    done = run("export", str(out), *wishes.split(), "--pseudonyms", str(key), "--database", database)
    assert done.returncode == 0, done.stderr
    assert "Wrote 2 people" in done.stderr
    exported = open_export(out)
    exported.check_digests()
    assert exported.manifest.form == "psych-ds"
    assert {row["study"] for row in exported.people()} == {"full-path"}
    assert {row["created_at"].year for row in exported.people()} != {1970}
    assert "samples" not in exported.tables
    assert list((out / "materials" / "clips").glob("*.glb"))
    assert len(key.read_text().splitlines()) == 3
    assert all(row["person_id"].startswith("P") for row in exported.people())


def test_real_people_are_written_as_csv_unless_told_otherwise(database: str, tmp_path: Path) -> None:
    assert run("export", str(tmp_path / "out"), "--database", database).returncode == 0
    exported = open_export(tmp_path / "out")
    assert exported.manifest.form == "csv"
    assert [row["source"] for row in exported.people()] == ["joined"] * 3


@pytest.mark.parametrize(
    ("wishes", "said"),
    [
        (["--people", "imported"], "found nobody"),
        (["--study", "quick"], "the name of a study, got 'quick'"),
        (["--pseudonyms", "/nowhere/key.csv"], "Can't write the key"),
    ],
)
def test_what_cannot_be_done_is_one_line(database: str, tmp_path: Path, wishes: list[str], said: str) -> None:
    done = run("export", str(tmp_path / "out"), *wishes, "--database", database)
    assert_one_line_with(done, said)
    assert list(tmp_path.iterdir()) == []
