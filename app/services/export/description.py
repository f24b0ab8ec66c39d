"""What an export says of itself to people and programs: `dataset_description.json`, `codebook.csv` and `README.md`."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.services.export.columns import Column, TableSchema
from app.services.export.layout import MANIFEST, Form, materials, table_path
from study_core.study import Study

_KINDS = {
    "string": "Text.",
    "integer": "Whole number.",
    "number": "Number, a double.",
    "boolean": "true or false.",
    "timestamp": "Time in ISO 8601 with its offset.",
    "json": "Any JSON value.",
}


def write_description(
    folder: Path, form: Form, tables: Sequence[TableSchema], studies: Sequence[Study]
) -> None:
    """Writes the description of every column, for programs and for people."""
    description = json.dumps(_dataset(form, tables, studies), indent=1, ensure_ascii=False)
    (folder / "dataset_description.json").write_text(description + "\n", encoding="utf-8")
    _write_codebook(folder / "codebook.csv", tables)
    (folder / "README.md").write_text(_readme(form, tables, studies), encoding="utf-8")
    if form == "psych-ds":
        # What the standard has no rule for.
        (folder / ".psychdsignore").write_text(f"{MANIFEST}\ncodebook.csv\ndigests\n", encoding="utf-8")


def _names(studies: Sequence[Study]) -> list[str]:
    return sorted({study.name for study in studies})


def _dataset(form: Form, tables: Sequence[TableSchema], studies: Sequence[Study]) -> dict[str, Any]:
    """Returns the data set as schema.org describes one, and Psych-DS asks for it."""
    names = _names(studies)
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": ", ".join(names),
        "description": (
            "People compared animated trajectories, two at a time, and a model of their preferences learned along. "
            f"Exported by prefstudy from {'the study' if len(names) == 1 else 'the studies'} {', '.join(names)}."
        ),
        "keywords": ["preferences", "pairwise comparison", "robotics"],
        "variableMeasured": list(_variables(tables)),
        "distribution": [
            {
                "@type": "DataDownload",
                "name": table.name,
                "description": table.description,
                "contentUrl": table_path(form, table.name),
            }
            for table in tables
        ],
    }


def _variables(tables: Sequence[TableSchema]) -> Iterator[dict[str, Any]]:
    """Gives every column once; where tables mean different things by a name, what it says in each."""
    columns: dict[str, Column] = {}
    meanings: dict[str, dict[str, list[str]]] = {}
    for table in tables:
        for column in table.columns:
            columns.setdefault(column.name, column)
            meanings.setdefault(column.name, {}).setdefault(column.description, []).append(table.name)
    for name, told in meanings.items():
        column, descriptions = columns[name], list(told)
        if len(told) > 1:
            column = replace(column, levels=(), least=None, most=None)
            descriptions = [f"In {', '.join(where)}: {meaning}" for meaning, where in told.items()]
        yield _variable(column, " ".join((*descriptions, _KINDS[column.kind])))


def _variable(column: Column, description: str) -> dict[str, Any]:
    bounds = {"minValue": column.least, "maxValue": column.most}
    return {
        "@type": "PropertyValue",
        "name": column.name,
        "description": description,
        **({"unitText": column.unit} if column.unit else {}),
        **{key: value for key, value in bounds.items() if value is not None},
        **({"valuePattern": "|".join(column.levels)} if column.levels else {}),
    }


def _write_codebook(path: Path, tables: Sequence[TableSchema]) -> None:
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("table", "column", "type", "unit", "least", "most", "levels", "description"))
        for table in tables:
            for column in table.columns:
                levels = "|".join(column.levels)
                bounds = ("" if bound is None else bound for bound in (column.least, column.most))
                row = (table.name, column.name, column.kind, column.unit, *bounds, levels, column.description)
                writer.writerow(row)


def _readme(form: Form, tables: Sequence[TableSchema], studies: Sequence[Study]) -> str:
    rows = [f"| `{table_path(form, table.name)}` | {table.description} |" for table in tables]
    where = materials(form)
    lines = [
        f"# {', '.join(_names(studies))}",
        "",
        "People compared animated trajectories, two at a time, and a model of their preferences learned along.",
        "",
        "| file | what it holds |",
        "| --- | --- |",
        *rows,
        "| `codebook.csv` | Every column of every table, with type, unit, levels and meaning. |",
        f"| `{where}studies/` | The study files, each under the SHA-256 of its text: `study_hash`. |",
        f"| `{where}texts/` | What people read. |",
        f"| `{where}networks/` | Models that were learned, each under its SHA-256. |",
        f"| `{where}clips/` | The animations (glTF), each under its SHA-256, if they were exported. |",
        f"| `{MANIFEST}`, `digests/` | Digests of every row, column and file; `prefstudy replay` checks them. |",
        "",
        "Rows of one person have the same `person_id`; what belongs to one query has the same `query_index` as well. "
        "`choice` says which trajectory was chosen, A or B; `position_chosen` where it stood on the screen.",
        "",
    ]
    return "\n".join(lines)
