import json
from pathlib import Path

import pytest

from app.new_file import NewFileError
from app.services.table import TableError, new_table

ROWS = [
    {"who": "p1", "weight": {"lane": 0.5, "speed": 0.25}, "pair": [1, 2]},
    {"who": "p2", "weight": {"lane": 1.0, "speed": 0.0}, "pair": [3, 4]},
]


def write(path: Path) -> str:
    with new_table(path) as table:
        for row in ROWS:
            table.write(row)
    return path.read_text()


def test_csv_has_a_column_for_each_entry(tmp_path: Path) -> None:
    assert (
        write(tmp_path / "t.csv")
        == "who,weight_lane,weight_speed,pair_0,pair_1\np1,0.5,0.25,1,2\np2,1.0,0.0,3,4\n"
    )


def test_json_lines_keep_entries_together(tmp_path: Path) -> None:
    assert [json.loads(line) for line in write(tmp_path / "t.jsonl").splitlines()] == ROWS


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"ends in \.csv or \.jsonl"), new_table(tmp_path / "t.xlsx"):
        pass


def test_a_file_that_exists_is_never_overwritten(tmp_path: Path) -> None:
    write(tmp_path / "t.csv")
    with pytest.raises(NewFileError, match="Name a new file"), new_table(tmp_path / "t.csv"):
        pass
