"""A table in a file of its own."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from app.services.export import ExportError
from app.services.export.columns import Column, TableSchema
from app.services.export.single import new_table

TABLE = TableSchema(
    "some",
    "Some rows.",
    (
        Column("who", "string", "Somebody."),
        Column("weight", "number", "A weight."),
        Column("n", "integer", "A number."),
    ),
    block=2,
)
ROWS = [{"who": f"p{i}", "weight": i / 3, "n": i} for i in range(5)]


def write(path: Path) -> None:
    with new_table(path, TABLE) as add:
        for row in ROWS:
            add([row])


def test_every_form_holds_every_row(tmp_path: Path) -> None:
    for suffix in ("csv", "parquet", "jsonl"):
        write(tmp_path / f"t.{suffix}")
    assert [json.loads(line) for line in (tmp_path / "t.jsonl").read_text().splitlines()] == ROWS
    assert pd.read_csv(tmp_path / "t.csv").to_dict("records") == ROWS
    assert pd.read_parquet(tmp_path / "t.parquet").to_dict("records") == ROWS


def test_what_was_added_stays_when_somebody_stops(tmp_path: Path) -> None:
    def stop() -> None:
        with new_table(tmp_path / "t.csv", TABLE) as add:
            add(ROWS[:3])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    assert pd.read_csv(tmp_path / "t.csv").to_dict("records") == ROWS[:3]


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"ends in \.csv, \.parquet or \.jsonl"):
        write(tmp_path / "t.xlsx")


def test_a_file_that_exists_is_never_overwritten(tmp_path: Path) -> None:
    write(tmp_path / "t.csv")
    with pytest.raises(ExportError, match="Name a new file"):
        write(tmp_path / "t.csv")


def test_a_file_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="No such file or directory"):
        write(tmp_path / "nowhere" / "t.csv")
