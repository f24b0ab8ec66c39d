"""Whole evaluations and reports of a few made-up people, by the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from app.cli import cli
from app.store import open_store
from study_core.predictors.registry import all_predictors
from tests.support.published import write_person

PREDICTORS = {predictor.name for predictor in all_predictors(1)}


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("published")
    for number, n_active in ((1, 16), (2, 14), (6, 5)):
        write_person(folder, number, n_active=n_active, n_test=12)
    url = f"sqlite:///{folder / 'people.db'}"
    assert CliRunner().invoke(cli, ["import", str(folder), "--database", url]).exit_code == 0
    return url


@pytest.fixture(scope="module")
def evaluation(database: str) -> Result:
    done = CliRunner().invoke(cli, ["evaluate", "--database", database, "--new-person", "--json"])
    assert done.exit_code == 0, done.output
    return done


def test_an_evaluation_prints_every_predictor_for_every_person(evaluation: Result) -> None:
    result = json.loads(evaluation.stdout)
    assert set(result["people"]) == {"1", "2"}
    assert all(set(of_person) == PREDICTORS for of_person in result["people"].values())
    for key in ("mean", "interval", "log_loss", "expected_accuracy", "validation_log_loss"):
        assert set(result[key]) == PREDICTORS
    losses = result["validation_log_loss"]
    assert result["recommended"] == min(losses, key=losses.get)
    assert result["mean"]["hierarchical"] == pytest.approx(
        sum(of_person["hierarchical"] for of_person in result["people"].values()) / 2, abs=1e-3
    )
    assert result["left_out"] == ["Person 6 has 5 active answers that prefer a side; 14 are needed."]
    assert "Person 6 has 5" in evaluation.stderr


def test_somebody_new_is_predicted_with_and_without_the_others(evaluation: Result) -> None:
    found = json.loads(evaluation.stdout)["new_person"]
    together = {"hierarchical", "shared-network"}
    hand_coded = {"hand-coded-population", "hand-coded-calibrated"}
    assert set(found) == together | {f"{name}-alone" for name in together} | hand_coded
    for by_number in found.values():
        assert list(by_number) == ["0", "5", "10", "20", "50", "100"]
        # Nobody has given more than 16 answers.
        assert by_number["20"] == by_number["100"]
    assert [found[f"{name}-alone"]["0"] for name in sorted(together)] == [0.5, 0.5]
    assert all(found[name]["0"] != 0.5 for name in together)


@pytest.mark.slow
def test_a_report_shows_every_figure_and_overwrites_nothing(database: str, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    done = CliRunner().invoke(cli, ["report", str(out), "--database", database])
    assert done.exit_code == 0, done.output
    page = out.read_text(encoding="utf-8")
    assert page.count("<svg ") == 10
    assert all(name in page for name in PREDICTORS)
    assert "answers (SHA-256)" in page
    # Two people with other numbers of queries had two studies of one name.
    assert re.search(r"<dt>study katz2021-published</dt><dd>[0-9a-f]{64} [0-9a-f]{64}</dd>", page)
    assert "Person 6 has 5 active answers" in page
    again = CliRunner().invoke(cli, ["report", str(out), "--database", database])
    assert "Name a new file" in str(again.exception)
    assert out.read_text(encoding="utf-8") == page


def test_a_report_of_nobody_leaves_no_file(tmp_path: Path) -> None:
    out, url = tmp_path / "report.html", f"sqlite:///{tmp_path / 'empty.db'}"
    open_store(url).close()
    done = CliRunner().invoke(cli, ["report", str(out), "--database", url])
    assert "Import or finish some sessions first" in str(done.exception)
    assert not out.exists()
