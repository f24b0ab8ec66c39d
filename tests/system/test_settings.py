"""The settings page is what the code reads, and says what every setting means."""

import re
from pathlib import Path

from study_core.reference import settings_table
from study_core.study_file import StudyFile
from tests.support.command_line import run

PAGE = Path(__file__).parents[2] / "docs" / "settings.md"


def test_the_page_is_what_the_command_prints() -> None:
    printed = run("settings").stdout
    assert PAGE.read_text() == printed, "run: prefstudy settings > docs/settings.md"


def test_every_setting_is_explained() -> None:
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    assert len(rows) > 80
    assert [row for row in rows if re.search(r"\|\s*\|$", row)] == []


def test_every_section_of_a_study_file_has_its_table() -> None:
    headings = re.findall(r"^### `\[+([a-z]+)", settings_table(), flags=re.MULTILINE)
    own = re.findall(r"^\| `(\w+)`", settings_table().split("###")[1], flags=re.MULTILINE)
    assert set(headings) | set(own) == set(StudyFile.model_fields)
