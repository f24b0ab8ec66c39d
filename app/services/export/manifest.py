"""The manifest of an export: what form it has, what its columns are, and the digests of everything in it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.services.export.columns import Column, TableSchema
from app.services.export.errors import ExportError
from app.services.export.layout import FORMS, MANIFEST, VERSION, Form
from app.services.export.values import canonical_json

_WHAT = "prefstudy export"


@dataclass(frozen=True)
class Manifest:
    """What an export says of itself.

    Attributes:
        form: Of its tables' files.
        code_version: Version of prefstudy that wrote it.
        tables: By name.
        n_rows: Of each table.
        table_digests: SHA-256 of each table, whatever its form.
        file_digests: SHA-256 of every other file, by its path from the folder.
    """

    form: Form
    code_version: str
    tables: Mapping[str, TableSchema]
    n_rows: Mapping[str, int]
    table_digests: Mapping[str, str]
    file_digests: Mapping[str, str]

    @property
    def digest(self) -> str:
        """Returns the SHA-256 of all tables together: the same for the same rows in any form."""
        return hashlib.sha256(canonical_json(dict(self.table_digests)).encode()).hexdigest()

    def write(self, folder: Path) -> None:
        """Writes it into an export's folder."""
        tables = {
            name: {
                "description": table.description,
                "n_rows": self.n_rows[name],
                "sha256": self.table_digests[name],
                "block": table.block,
                "columns": [asdict(column) for column in table.columns],
            }
            for name, table in self.tables.items()
        }
        content = {
            "what": _WHAT,
            "version": VERSION,
            "form": self.form,
            "code_version": self.code_version,
            "sha256": self.digest,
            "tables": tables,
            "files": dict(self.file_digests),
        }
        (folder / MANIFEST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def file_digest(path: Path) -> str:
    """Returns the SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_manifest(folder: Path) -> Manifest:
    """Returns the manifest of the export in a folder.

    Raises:
        ExportError: There is none, it is damaged, or a later version wrote it.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ExportError(
            f"Expected an export in {folder}, found no {MANIFEST}. Name the folder that `prefstudy export` wrote, or "
            "the one in the desk's zip file; what has no such file is too old, and is exported again from its database."
        ) from error
    except (OSError, ValueError) as error:
        raise ExportError(f"Can't read {path}: {error}. Export again.") from error
    if not isinstance(content, dict) or content.get("what") != _WHAT:
        raise ExportError(f"{path} isn't an export's manifest. Name a folder that `prefstudy export` wrote.")
    if content.get("version") != VERSION:
        raise ExportError(
            f"{path}: expected version {VERSION} of an export, got {content.get('version')}, which prefstudy "
            f"{content.get('code_version')} wrote. Install that release, or export again with this one."
        )
    try:
        return _manifest(content)
    except (KeyError, TypeError, ValueError) as error:
        raise ExportError(f"{path} is damaged: {error!r}. Export again.") from error


def _manifest(content: dict[str, Any]) -> Manifest:
    if content["form"] not in FORMS:
        raise ValueError(f"no form is called {content['form']}")
    told = content["tables"]
    tables = {
        name: TableSchema(name, table["description"], tuple(map(_column, table["columns"])), table["block"])
        for name, table in told.items()
    }
    manifest = Manifest(
        content["form"],
        content["code_version"],
        tables,
        {name: table["n_rows"] for name, table in told.items()},
        {name: table["sha256"] for name, table in told.items()},
        content["files"],
    )
    if manifest.digest != content["sha256"]:
        raise ValueError("its digests don't add up")
    return manifest


def _column(told: dict[str, Any]) -> Column:
    return Column(**{**told, "levels": tuple(told["levels"])})
