"""The same rows and types in every form, for our reader and for other people's."""

from __future__ import annotations

import csv
import json
import math
import re
from datetime import UTC, datetime
from typing import Any

import pandas as pd
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.services.export import Export
from app.services.export.columns import Column, TableSchema
from app.services.export.files import batches_in, new_file
from app.services.export.layout import FORMS
from app.services.export.values import batch_of, rows_of

KINDS = ("string", "integer", "number", "boolean", "timestamp", "json")
ANY = TableSchema("any", "Any values.", tuple(Column(kind, kind, "Any value.") for kind in KINDS))  # type: ignore[arg-type]

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)
# Text as people can type and JSON can carry it: without surrogates, which no UTF-8 holds.
any_text = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
any_row = st.fixed_dictionaries(
    {
        "string": st.none() | any_text,
        "integer": st.none() | st.integers(-(2**63) + 1, 2**63 - 1),
        "number": st.none() | st.floats(allow_nan=False, allow_infinity=False),
        "boolean": st.none() | st.booleans(),
        "timestamp": st.none()
        | st.datetimes(datetime(1970, 1, 1), datetime(2200, 1, 1), timezones=st.just(UTC)),  # noqa: DTZ001
        "json": json_values,
    }
)


@pytest.mark.parametrize("form", ["csv", "parquet", "jsonl"])
@given(rows=st.lists(any_row, min_size=1, max_size=4))
def test_whatever_a_table_may_hold_comes_back_as_it_was(
    form: str, rows: list[dict[str, Any]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("any") / "any"
    with new_file(path, form, ANY) as write:  # type: ignore[arg-type]
        write(batch_of(ANY, rows))
    found = [row for batch in batches_in(path, form, ANY) for row in rows_of(ANY, batch)]  # type: ignore[arg-type]
    assert found == rows
    # -0.0 equals 0.0.
    signs = [[math.copysign(1, row["number"] or 1.0) for row in some] for some in (found, rows)]
    assert signs[0] == signs[1]


def test_a_number_that_is_not_finite_is_nothing() -> None:
    row = dict.fromkeys(KINDS) | {"number": math.inf}
    assert rows_of(ANY, batch_of(ANY, [row, row | {"number": math.nan}])) == [dict.fromkeys(KINDS)] * 2


@pytest.mark.parametrize(
    "wrong",
    [
        {"integer": 1.0},
        {"integer": True},
        {"integer": 2**63},
        {"number": 10**400},
        {"number": "1"},
        {"boolean": 1},
        {"string": 1},
        {"odd": 1},
    ],
)
def test_a_value_of_another_kind_or_an_undeclared_column_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        batch_of(ANY, [wrong])


def test_every_form_holds_the_same_rows(exports: dict[str, Export]) -> None:
    tables = exports["csv"].tables
    for table in tables:
        expected = list(exports["parquet"].rows(table))
        for form in FORMS:
            assert list(exports[form].rows(table)) == expected
    assert all(list(exports["parquet"].rows(table)) for table in tables)


def test_the_digest_is_the_same_in_every_form(exports: dict[str, Export]) -> None:
    assert len({export.manifest.digest for export in exports.values()}) == 1


def test_pandas_reads_the_same_types_and_numbers_from_csv_and_parquet(exports: dict[str, Export]) -> None:
    for table in exports["csv"].tables:
        flat = pd.read_csv(exports["csv"].path_of(table))
        typed = pd.read_parquet(exports["parquet"].path_of(table))
        assert list(flat.columns) == list(typed.columns)
        assert len(flat) == len(typed)
        for column in exports["csv"].manifest.tables[table].columns:
            one, other = flat[column.name].dropna(), typed[column.name].dropna()
            if column.kind in ("number", "integer", "boolean"):
                assert one.astype(float).tolist() == other.astype(float).tolist()
                if column.kind == "boolean" and len(one):
                    assert set(one) <= {True, False}
            elif column.kind == "timestamp":
                assert pd.to_datetime(one, format="ISO8601").tolist() == other.tolist()
            elif column.kind == "string":
                assert one.astype(str).tolist() == [value for value in other if value != ""]
            else:
                assert [json.loads(text) for text in one] == [json.loads(text) for text in other]


def type_convert(texts: list[str]) -> tuple[str, list[Any]]:
    """What base R makes of a column of text: `read.csv` with `type.convert(as.is = TRUE, na.strings = "")`.

    Logical if every value is one of R's words for it, else integer if every value is one of 32 bits, else double if
    every value is a decimal number, else character; empty cells are missing, except in character columns.
    """
    known = [text for text in texts if text != ""]
    if all(text in ("T", "F", "TRUE", "FALSE", "true", "false", "True", "False") for text in known):
        return "logical", [None if text == "" else text.upper().startswith("T") for text in texts]
    if all(re.fullmatch(r"\s*[+-]?\d+\s*", text) and abs(int(text)) < 2**31 for text in known):
        return "integer", [None if text == "" else int(text) for text in texts]
    if all(re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", text) for text in known):
        return "double", [None if text == "" else float(text) for text in texts]
    return "character", [None if text == "" else text for text in texts]


ALLOWED = {
    "string": {"character"},
    "integer": {"integer"},
    "number": {"integer", "double"},
    "boolean": {"logical"},
    "timestamp": {"character"},
}


def test_base_r_reads_the_same_types_and_numbers(exports: dict[str, Export]) -> None:
    export = exports["csv"]
    n_checked = 0
    for table in export.tables:
        with export.path_of(table).open(newline="", encoding="utf-8") as file:
            header, *lines = csv.reader(file)
        rows = list(export.rows(table))
        for column, texts in zip(
            export.manifest.tables[table].columns, zip(*lines, strict=True), strict=True
        ):
            assert column.name in header
            if column.kind == "json" or all(text == "" for text in texts):
                continue
            kind, values = type_convert(list(texts))
            assert kind in ALLOWED[column.kind], (table, column.name)
            expected = [row[column.name] for row in rows]
            if column.kind == "timestamp":
                expected = [None if at is None else at.isoformat(timespec="microseconds") for at in expected]
            assert values == expected
            n_checked += 1
    assert n_checked > 100


def test_json_readers_see_the_same_types(exports: dict[str, Export]) -> None:
    types = {
        "string": str,
        "integer": int,
        "number": float,
        "boolean": bool,
        "timestamp": str,
    }
    export = exports["jsonl"]
    for table in export.tables:
        lines = export.path_of(table).read_text(encoding="utf-8").splitlines()
        for line, row in zip(lines, exports["parquet"].rows(table), strict=True):
            found = json.loads(line)
            for column in export.manifest.tables[table].columns:
                value = found[column.name]
                if column.kind == "json":
                    assert value == row[column.name]
                elif value is not None:
                    assert type(value) is types[column.kind]
                    same = datetime.fromisoformat(value) if column.kind == "timestamp" else value
                    assert same == row[column.name]


def test_times_in_csv_and_json_lines_have_their_offset(exports: dict[str, Export]) -> None:
    at = json.loads(exports["jsonl"].path_of("people").read_text().splitlines()[0])["created_at"]
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}\+00:00", at)
    assert f'"{at}"' in exports["csv"].path_of("people").read_text()


def test_parquet_says_what_each_column_is(exports: dict[str, Export]) -> None:
    schema = pa.parquet.read_schema(exports["parquet"].path_of("answers"))
    told = schema.field("response_time_ms").metadata[b"description"].decode()
    assert told == "As measured in the browser."
