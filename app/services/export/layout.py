"""Where things stand in an exported folder."""

from __future__ import annotations

from typing import Literal, get_args

Form = Literal["csv", "parquet", "jsonl", "psych-ds"]
FileForm = Literal["csv", "parquet", "jsonl"]
FORMS: tuple[Form, ...] = get_args(Form)

MANIFEST = "manifest.json"
VERSION = 1
"""Of the form of an export; a reader refuses a later one."""


def file_form(form: Form) -> FileForm:
    """Returns the form of each table's file."""
    return "csv" if form == "psych-ds" else form


def table_path(form: Form, table: str) -> str:
    """Returns where a table's file is; Psych-DS has its own rule for names."""
    return f"data/description-{table}_data.csv" if form == "psych-ds" else f"{table}.{form}"


def materials(form: Form) -> str:
    """Returns the folder of studies, texts, clips and networks."""
    return "materials/" if form == "psych-ds" else ""


def digests_path(table: str) -> str:
    """Returns where the digests of a table's rows are."""
    return f"digests/{table}.jsonl"
