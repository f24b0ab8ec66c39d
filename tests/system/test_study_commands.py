"""`new` writes a study that can be run, and `check` says what a study will do or what is wrong with it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.support.command_line import assert_one_line_with, run


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def checked(path: str) -> dict[str, object]:
    done = run("check", path, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_new_study_can_be_checked_at_once(folder: Path) -> None:
    done = run("new", "my-study")
    assert done.returncode == 0, done.stderr
    assert "prefstudy check my-study.toml" in done.stdout
    found = checked("my-study.toml")
    assert found["n_queries"] == {"practice": 2, "active": 40, "repeat": 4, "check": 2, "test": 20}
    assert found["cost"] == "239.40 EUR"  # 40 x 4.50 x 1.33
    assert found["pages"][:2] == ["welcome", "consent"]
    assert 0 < found["seconds_per_query"] < 60
    assert found["people_at_once_per_core"] >= 1


def test_every_line_of_a_new_study_that_is_commented_out_can_be_put_in(folder: Path) -> None:
    run("new", "whole")
    text = Path("whole.toml").read_text()
    uncommented = re.sub(r"^# (\[\[|\w+(\.\w+)* = )", r"\1", text, flags=re.MULTILINE)
    assert uncommented.count("[[condition]]") == 2
    uncommented = uncommented.replace('answers = ["a", "b"] ', 'answers = ["a", "b", "same"] ')
    Path("whole.toml").write_text(uncommented)
    found = checked("whole.toml")
    assert found["conditions"] == ["informative", "random"]


def test_two_new_studies_have_seeds_of_their_own(folder: Path) -> None:
    for name in ("one", "two"):
        run("new", name)
    seeds = {
        re.search(r"^seed = (\d+)", Path(f"{name}.toml").read_text(), re.MULTILINE)[1]
        for name in ("one", "two")
    }
    assert len(seeds) == 2


def test_a_study_is_never_overwritten_and_its_name_is_one_for_links(folder: Path) -> None:
    Path("mine.toml").write_text("precious")
    assert_one_line_with(run("new", "mine"), "mine.toml", "Name a new file")
    assert Path("mine.toml").read_text() == "precious"
    assert_one_line_with(run("new", "My Study"), "small letters")
    assert list(folder.iterdir()) == [folder / "mine.toml"]


def test_everything_that_is_wrong_is_said_with_its_line(folder: Path) -> None:
    run("new", "mine")
    text = Path("mine.toml").read_text()
    wrong = text.replace("active_queries = 40", "active_querys = 40").replace("places = 40", "places = -3")
    Path("mine.toml").write_text(wrong)
    lines = wrong.splitlines()
    done = run("check", "mine.toml")
    assert done.returncode == 1
    said = dict(re.findall(r"mine\.toml:(\d+): (.*)", done.stderr))
    places = {lines[int(number) - 1].split(" ")[0]: message for number, message in said.items()}
    assert "did you mean 'active_queries'" in places["active_querys"]
    assert "got -3" in places["places"]
    assert "missing" in places["[protocol]"]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (("repeats = 4 ", "repeats = 21 "), "repeats can be at most half of active_queries, 20; got 21"),
        (('method = "information-gain-realistic"', 'method = "informatoin-gain"'), "information-gain"),
        (('title = "How', "title = How"), "not valid TOML"),
    ],
)
def test_what_cannot_be_run_is_refused(folder: Path, spoil: tuple[str, str], said: str) -> None:
    run("new", "mine")
    text = Path("mine.toml").read_text()
    assert spoil[0] in text
    Path("mine.toml").write_text(text.replace(*spoil))
    done = run("check", "mine.toml")
    assert done.returncode == 1
    assert said in done.stderr
    assert_one_line_with(run("check", "nowhere"), "No study file 'nowhere'")


def test_what_may_be_forgotten_is_named(folder: Path) -> None:
    run("new", "mine")
    said = run("check", "mine.toml").stderr
    assert "consent page is the ready one" in said.replace("\n", " ")
    assert "Completion codes are still to be changed: CHANGE-ME-1" in said.replace("\n", " ")
    Path("mine").mkdir()
    Path("mine/consent.en.md").write_text("Our own.")
    Path("mine.toml").write_text(Path("mine.toml").read_text().replace("CHANGE-ME", "ABC"))
    said = run("check", "mine.toml").stderr
    assert "Note:" not in said
