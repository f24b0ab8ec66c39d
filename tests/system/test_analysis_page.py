"""The documentation's example of analysing an export runs, and finds what is known of simulated people."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.support.command_line import run

PAGE = Path(__file__).parents[2] / "docs" / "analysis.md"
STUDY = """
[[condition]]
name = "gain"
acquisition.method = "information-gain"

[[condition]]
name = "random"
acquisition.method = "random"
"""


@pytest.fixture
def exported(tmp_path, monkeypatch):
    """What the page's own commands write, for people who know what they like."""
    monkeypatch.chdir(tmp_path)
    run("new", "my-study")
    text = Path("my-study.toml").read_text()
    short = text.replace("active_queries = 40", "active_queries = 8").replace(
        "test_queries = 20", "test_queries = 6"
    )
    Path("my-study.toml").write_text(short.replace("repeats = 4", "repeats = 2") + STUDY)
    commands = [
        line.split() for line in re.findall(r"^    prefstudy (.+try\.db)$", PAGE.read_text(), re.MULTILINE)
    ]
    assert [command[0] for command in commands] == ["simulate", "export"]
    for command in commands:
        done = run(*(word.replace("12", "6") for word in command))
        assert done.returncode == 0, done.stderr


def test_the_example_runs_as_it_stands(exported):
    code = "\n".join(re.findall(r"^```python\n(.+?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL))
    found = {}
    exec(compile(code, str(PAGE), "exec"), found)

    analysed = set(found["analysed"]["person_id"])
    assert 2 <= len(analysed) < 6
    assert set(found["accuracy"].index) == analysed
    assert set(found["by_condition"].index) <= {"gain", "random"}
    assert found["by_condition"]["size"].sum() == len(analysed)
    assert set(found["demographics"].columns) >= {"age", "gender"}
    np.testing.assert_array_equal(np.isnan(found["reward"]), False)
    assert set(found["asked"]["phase"]) == {"practice", "active", "repeat", "check", "test"}
