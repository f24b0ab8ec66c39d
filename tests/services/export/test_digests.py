"""Whatever is changed in an export is found, and named."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pyarrow as pa
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.services.export import Export, ExportDifferenceError, ExportOptions, export, open_export
from app.services.export.columns import Column, Row
from app.services.export.digests import TableDigest
from app.services.export.files import batches_in, new_file
from app.services.export.layout import file_form
from app.services.export.values import batch_of, rows_of
from app.store import open_store

CHANGES: dict[str, Callable[[Any], Any]] = {
    "string": lambda value: "x" if value is None else value + " ",
    "integer": lambda value: 0 if value is None else value + 1,
    "number": lambda value: 0.0 if value is None else math.nextafter(value, math.inf),
    "boolean": lambda value: True if value is None else not value,
    "timestamp": lambda value: value + timedelta(microseconds=1),
    "json": lambda value: [value],
}


def rewrite(opened: Export, table: str, change: Callable[[list[Row]], list[Row]]) -> None:
    """Writes a table's file anew, with other rows."""
    schema, path = opened.manifest.tables[table], opened.path_of(table)
    form = file_form(opened.manifest.form)
    rows = [row for batch in batches_in(path, form, schema) for row in rows_of(schema, batch)]
    path.unlink()
    with new_file(path, form, schema) as write:
        write(batch_of(schema, change(rows)))


@pytest.fixture(scope="module")
def small(database: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Export]:
    """Exports without all their samples, which would have to be read again for every example."""
    folder = tmp_path_factory.mktemp("small")
    with open_store(database) as store:
        for form in ("csv", "parquet", "jsonl"):
            export(store, folder / form, ExportOptions(form, "all"))  # type: ignore[arg-type]
    return {form: open_export(folder / form) for form in ("csv", "parquet", "jsonl")}


def test_an_untouched_export_is_as_it_was_written(exports: dict[str, Export]) -> None:
    for export_ in exports.values():
        seen: list[int] = []
        export_.check_digests(seen.append)
        assert sum(seen) == sum(export_.manifest.n_rows.values())


@pytest.mark.parametrize("form", ["csv", "parquet", "jsonl"])
@settings(max_examples=60)
@given(data=st.data())
def test_any_single_changed_value_is_found_and_named(
    small: dict[str, Export], form: str, data: st.DataObject
) -> None:
    opened = small[form]
    table = data.draw(st.sampled_from([name for name, n in opened.manifest.n_rows.items() if n]))
    number = data.draw(st.integers(0, opened.manifest.n_rows[table] - 1))
    column: Column = data.draw(st.sampled_from(opened.manifest.tables[table].columns))
    told: list[Row] = []

    def change(rows: list[Row]) -> list[Row]:
        rows[number][column.name] = CHANGES[column.kind](rows[number][column.name])
        told.append(rows[number])
        return rows

    path = opened.path_of(table)
    kept = path.read_bytes()
    rewrite(opened, table, change)
    try:
        with pytest.raises(ExportDifferenceError) as caught:
            opened.check_digests()
    finally:
        path.write_bytes(kept)
    message = str(caught.value)
    (row,) = told
    assert message.startswith(f"{path}, row {number + 1}")
    assert "\n" not in message
    assert f"{column.name} is " in message
    for key, what in (("person_id", "person"), ("query_index", "query"), ("position", "log position")):
        assert row.get(key) is None or f"{what} {row[key]}" in message
    if column.kind == "number":
        assert f"{column.name} is {row[column.name]!r}" in message


def test_a_changed_number_is_told_beside_the_one_in_the_log(copied: Callable[[str], Export]) -> None:
    opened = copied("jsonl")
    before: list[float] = []

    def change(rows: list[Row]) -> list[Row]:
        before.append(rows[5]["controls_b_4"])
        rows[5]["controls_b_4"] = 0.123
        return rows

    rewrite(opened, "queries", change)
    with pytest.raises(ExportDifferenceError) as caught:
        opened.check_digests()
    assert f"controls_b_4 of queries is 0.123 there and {before[0]!r} in the log" in str(caught.value)


def test_a_number_changed_in_the_log_is_told_beside_the_one_in_its_table(
    copied: Callable[[str], Export],
) -> None:
    opened = copied("csv")
    expected: list[float] = []

    def change(rows: list[Row]) -> list[Row]:
        row = next(each for each in rows if each["kind"] == "query_prepared")
        expected.append(row["payload"]["query"]["controls_b"][4])
        row["payload"]["query"]["controls_b"][4] = 0.123
        return rows

    rewrite(opened, "events", change)
    with pytest.raises(ExportDifferenceError) as caught:
        opened.check_digests()
    assert "events.csv, row 2 (" in str(caught.value)
    assert f"controls_b_4 of queries is {expected[0]!r} there and 0.123 in the log" in str(caught.value)


@pytest.mark.parametrize("table", ["people", "answers", "samples"])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows[:-1], "is the last|missing at the end"),
        (lambda rows: rows[1:], "row 1 .* expected another row"),
        (lambda rows: [*rows, rows[0]], "expected no such row"),
        (lambda rows: [rows[1], rows[0], *rows[2:]], "row 1 .*"),
        (lambda rows: [], "missing at the end"),
    ],
)
def test_rows_that_were_removed_added_or_moved_are_found(
    copied: Callable[[str], Export], table: str, change: Callable[[list[Row]], list[Row]], said: str
) -> None:
    opened = copied("parquet")
    rewrite(opened, table, change)
    with pytest.raises(ExportDifferenceError, match=said):
        opened.check_digests()


def test_whoever_changes_a_row_and_its_digests_is_found_by_the_tables_own(
    copied: Callable[[str], Export],
) -> None:
    opened = copied("csv")
    path = opened.folder / "digests" / "answers.jsonl"

    def change(rows: list[Row]) -> list[Row]:
        rows[0]["choice"] = "b"
        schema = opened.manifest.tables["answers"]
        edges = TableDigest(schema).add(batch_of(schema, rows))
        path.write_text(json.dumps({"rows": edges.rows, "columns": edges.columns}) + "\n")
        return rows

    rewrite(opened, "answers", change)
    with pytest.raises(ExportDifferenceError, match="were both changed"):
        opened.check_digests()


@pytest.mark.parametrize("pattern", ["studies/*", "texts/*/welcome.en.md", "networks/*.json", "codebook.csv"])
def test_changed_and_missing_files_are_found(copied: Callable[[str], Export], pattern: str) -> None:
    opened = copied("csv")
    path = next(opened.folder.glob(pattern))
    with path.open("a") as file:
        file.write(" ")
    with pytest.raises(ExportDifferenceError, match=f"{path.name} was changed"):
        opened.check_digests()
    path.unlink()
    with pytest.raises(ExportDifferenceError, match=f"{path.name} was exported and is missing"):
        opened.check_digests()


@pytest.mark.parametrize(
    ("form", "old", "new", "said"),
    [
        ("csv", ",1234,", ",many,", "many"),
        ("csv", '"choice"', '"choose"', "missing: choice; unknown: choose"),
        ("jsonl", '"response_time_ms":1234', '"response_time_ms":"many"', "response_time_ms"),
        ("jsonl", '"answered_at":"2', '"answered_at":2,"odd":"2', "unknown: odd"),
        ("jsonl", '"choice":', '"choose":', "missing: choice; unknown: choose"),
        ("jsonl", "{", "", "isn't what was exported"),
    ],
)
def test_a_table_that_can_no_longer_be_read_is_named(
    copied: Callable[[str], Export], form: str, old: str, new: str, said: str
) -> None:
    opened = copied(form)
    path = opened.path_of("answers")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(ExportDifferenceError, match=f"answers.{form}.*{said}") as caught:
        opened.check_digests()
    assert "\n" not in str(caught.value)


def test_a_time_that_is_none_any_more_is_named(copied: Callable[[str], Export]) -> None:
    opened = copied("jsonl")
    path = opened.path_of("answers")
    first, *others = path.read_text().splitlines()
    for wrong in (5, "2026-01-01T10:00:00", "yesterday"):
        told = json.dumps(json.loads(first) | {"answered_at": wrong})
        path.write_text("\n".join([told, *others]))
        with pytest.raises(ExportDifferenceError, match=r"answers\.jsonl isn't what was exported"):
            opened.check_digests()


def test_a_parquet_file_whose_column_has_another_type_is_named(copied: Callable[[str], Export]) -> None:
    opened = copied("parquet")
    path = opened.path_of("answers")
    table = pyarrow.parquet.read_table(path)
    for wrong in (pa.array(["many"] * len(table)), pa.array([[1]] * len(table))):
        at = table.column_names.index("response_time_ms")
        pyarrow.parquet.write_table(table.set_column(at, "response_time_ms", wrong), path)
        with pytest.raises(
            ExportDifferenceError, match=r"answers\.parquet isn't what was exported"
        ) as caught:
            opened.check_digests()
        assert "\n" not in str(caught.value)


def test_a_parquet_file_that_was_cut_off_is_named(copied: Callable[[str], Export]) -> None:
    opened = copied("parquet")
    path = opened.path_of("answers")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ExportDifferenceError, match=r"answers\.parquet"):
        opened.check_digests()
