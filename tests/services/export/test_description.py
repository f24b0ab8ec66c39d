"""What an export says of itself: every column, once; and the rules of Psych-DS.

The rules are written down here from its documentation (psychds-docs.readthedocs.io, "Rules and conventions" and "Error
reference"); they share nothing with what writes the data set.
"""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest

from app.services.export import Export
from app.services.export.layout import FORMS
from study_core.comparison import Choice


def described(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "dataset_description.json").read_text(encoding="utf-8"))
    return content


def headers(folder: Path, pattern: str) -> dict[str, list[str]]:
    found = {}
    for path in folder.glob(pattern):
        with path.open(newline="", encoding="utf-8") as file:
            found[path.name] = next(csv.reader(file))
    return found


@pytest.mark.parametrize("form", FORMS)
def test_every_column_of_every_table_is_described_and_no_other(exports: dict[str, Export], form: str) -> None:
    folder = exports[form].folder
    variables = [each["name"] for each in described(folder)["variableMeasured"]]
    assert len(set(variables)) == len(variables)
    with (folder / "codebook.csv").open(newline="", encoding="utf-8") as file:
        codebook = [(row["table"], row["column"]) for row in csv.DictReader(file)]
    assert len(set(codebook)) == len(codebook)
    assert {column for _, column in codebook} == set(variables)
    if form == "csv":
        tables = {name.removesuffix(".csv"): names for name, names in headers(folder, "*.csv").items()}
        del tables["codebook"]
        assert [(table, name) for table, names in sorted(tables.items()) for name in names] == sorted(
            codebook, key=lambda each: each[0]
        )


def test_a_column_of_one_name_is_of_one_kind_and_unit_in_every_table(exports: dict[str, Export]) -> None:
    known: dict[str, tuple[str, str]] = {}
    for table in exports["csv"].manifest.tables.values():
        for column in table.columns:
            assert column.description.endswith("."), column
            assert known.setdefault(column.name, (column.kind, column.unit)) == (column.kind, column.unit)


def test_what_a_name_means_is_said_for_each_table_where_it_differs(exports: dict[str, Export]) -> None:
    told = {each["name"]: each for each in described(exports["csv"].folder)["variableMeasured"]}
    assert re.search(r"In steps: .* In networks: .* In events: ", told["kind"]["description"])
    assert told["choice"]["valuePattern"] == "|".join(Choice)
    assert (told["response_time_ms"]["unitText"], told["response_time_ms"]["minValue"]) == ("ms", 0)
    assert (told["confidence"]["minValue"], told["confidence"]["maxValue"]) == (1, 5)


def test_every_value_is_one_that_its_column_may_have(exports: dict[str, Export]) -> None:
    export = exports["parquet"]
    for name, table in export.manifest.tables.items():
        for row in export.rows(name):
            for column in table.columns:
                value = row[column.name]
                if value is None:
                    continue
                assert not column.levels or value in column.levels, (name, column.name, value)
                assert column.least is None or value >= column.least, (name, column.name, value)
                assert column.most is None or value <= column.most, (name, column.name, value)


class RuleError(Exception):
    """A rule of Psych-DS that a data set breaks; named as its validator names it."""


def validate(folder: Path) -> list[Path]:
    """Checks the rules whose breach is an error; returns the official data files."""
    metadata = _metadata(folder)
    data = folder / "data"
    if not data.is_dir():
        raise RuleError("MISSING_DATA_DIRECTORY")
    files = [path for path in data.rglob("*") if path.name.endswith("_data.csv")]
    if not files:
        raise RuleError("MISSING_DATAFILE")
    variables = {each if isinstance(each, str) else each["name"] for each in metadata["variableMeasured"]}
    for each in metadata["variableMeasured"]:
        if not isinstance(each, str) and each.get("@type", each.get("type")) != "PropertyValue":
            raise RuleError("OBJECT_TYPE_MISSING")
    found: set[str] = set()
    for path in files:
        if not re.fullmatch(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv", path.name):
            raise RuleError("FILENAME_KEYWORD_FORMATTING_ERROR")
        found |= _columns(path, variables)
    if variables - found:
        raise RuleError("VARIABLE_MISSING_FROM_CSV_COLUMNS")
    return files


def _metadata(folder: Path) -> dict[str, Any]:
    path = folder / "dataset_description.json"
    if not path.is_file():
        raise RuleError("MISSING_DATASET_DESCRIPTION")
    try:
        metadata: dict[str, Any] = json.loads(path.read_bytes().decode("utf-8"))
    except ValueError as error:
        raise RuleError("INVALID_JSON_FORMATTING") from error
    if metadata.get("@context", "").rstrip("/") not in ("http://schema.org", "https://schema.org"):
        raise RuleError("JSON_KEY_REQUIRED")
    if any(not metadata.get(key) for key in ("name", "description", "variableMeasured")):
        raise RuleError("JSON_KEY_REQUIRED")
    if metadata.get("@type", metadata.get("type")) not in ("Dataset", "https://schema.org/Dataset"):
        raise RuleError("INCORRECT_DATASET_TYPE")
    return metadata


def _columns(path: Path, variables: set[str]) -> set[str]:
    content = path.read_bytes()
    if not content:
        raise RuleError("FILE_EMPTY")
    rows = list(csv.reader(content.decode("utf-8").splitlines(keepends=True), strict=True))
    if not rows[0] or any(not name for name in rows[0]):
        raise RuleError("CSV_HEADER_MISSING")
    if len(set(rows[0])) != len(rows[0]):
        raise RuleError("CSV_HEADER_REPEATED")
    if any(len(row) != len(rows[0]) for row in rows):
        raise RuleError("CSV_HEADER_LENGTH_MISMATCH")
    if set(rows[0]) - variables:
        raise RuleError("CSV_COLUMN_MISSING_FROM_METADATA")
    if "row_id" in rows[0]:
        ids = [row[rows[0].index("row_id")] for row in rows[1:]]
        if len(set(ids)) != len(ids):
            raise RuleError("ROWID_VALUES_NOT_UNIQUE")
    return set(rows[0])


OFFICIAL_KEYWORDS = {
    "study", "site", "subject", "session", "task", "condition", "trial", "stimulus", "description",
}  # fmt: skip
# schema.org's properties of a Dataset and of a PropertyValue, as far as we use any.
OF_DATASET = {
    "@context", "@type", "name", "description", "variableMeasured", "keywords", "distribution",
}  # fmt: skip
OF_PROPERTY_VALUE = {"@type", "name", "description", "unitText", "minValue", "maxValue", "valuePattern"}


def test_a_psych_ds_export_keeps_the_rules(exports: dict[str, Export]) -> None:
    export = exports["psych-ds"]
    assert {path.name for path in validate(export.folder)} == {
        f"description-{table}_data.csv" for table in export.tables
    }


def test_a_psych_ds_export_follows_the_recommendations(exports: dict[str, Export]) -> None:
    folder = exports["psych-ds"].folder
    for path in folder.glob("data/*"):
        assert {part.partition("-")[0] for part in path.name.split("_")[:-1]} <= OFFICIAL_KEYWORDS
    metadata = described(folder)
    assert metadata.keys() <= OF_DATASET
    assert all(each.keys() <= OF_PROPERTY_VALUE for each in metadata["variableMeasured"])
    assert (folder / "README.md").is_file()
    at_the_top = {path.name for path in folder.iterdir()}
    known = {"dataset_description.json", "data", "materials", "README.md", ".psychdsignore"}
    assert at_the_top - known == set((folder / ".psychdsignore").read_text().split())
    assert {path.name for path in (folder / "materials").iterdir()} == {"studies", "texts", "networks"}


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda f: (f / "dataset_description.json").unlink(), "MISSING_DATASET_DESCRIPTION"),
        (lambda f: rewrite(f, "@context", "https://example.org"), "JSON_KEY_REQUIRED"),
        (lambda f: rewrite(f, "@type", "Thing"), "INCORRECT_DATASET_TYPE"),
        (lambda f: rewrite(f, "variableMeasured", ["person_id"]), "CSV_COLUMN_MISSING_FROM_METADATA"),
        (lambda f: (f / "data").rename(f / "date"), "MISSING_DATA_DIRECTORY"),
        (
            lambda f: (f / "data" / "description-people_data.csv").rename(f / "data" / "people_data.csv"),
            "FILENAME_KEYWORD_FORMATTING_ERROR",
        ),
        (
            lambda f: (f / "data" / "description-people_data.csv").open("a").write('"one"\n'),
            "CSV_HEADER_LENGTH_MISMATCH",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
def test_the_rules_can_be_broken(copied: Any, spoil: Any, code: str) -> None:
    folder = copied("psych-ds").folder
    spoil(folder)
    with pytest.raises(RuleError, match=code):
        validate(folder)


def rewrite(folder: Path, key: str, value: Any) -> None:
    content = described(folder) | {key: value}
    (folder / "dataset_description.json").write_text(json.dumps(content), encoding="utf-8")
