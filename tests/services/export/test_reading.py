"""Opening an export, and finding one person's rows in it."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.services.export import Export, ExportError, open_export
from app.services.export.layout import FORMS
from tests.services.export.people import QUICKSTART


@pytest.mark.parametrize("form", FORMS)
def test_logs_and_samples_are_found_in_any_order(exports: dict[str, Export], form: str) -> None:
    export = exports[form]
    logs: dict[str, list[Any]] = {}
    for row in export.rows("events"):
        logs.setdefault(row["person_id"], []).append(row)
    samples: dict[tuple[str, int], list[list[float]]] = {}
    for row in export.rows("samples"):
        values = [value for name, value in row.items() if name.startswith("sample_") and value is not None]
        samples.setdefault((row["person_id"], row["query_index"]), []).append(values)
    wanted = [*logs, *logs]
    random.Random(1).shuffle(wanted)
    for person_id in wanted:
        assert export.events(person_id) == logs[person_id]
    pairs = random.Random(2).sample(list(samples), 8)
    for pair in pairs:
        np.testing.assert_array_equal(export.samples(*pair), np.array(samples[pair]))


def test_what_is_not_there_is_empty(exports: dict[str, Export]) -> None:
    assert exports["csv"].events("nobody") == []
    assert exports["csv"].samples("nobody", 0).size == 0
    with pytest.raises(ExportError, match="has no table 'queery'"):
        list(exports["csv"].rows("queery"))


def test_a_study_is_what_its_hash_says(copied: Callable[[str], Export]) -> None:
    export = copied("psych-ds")
    assert export.study(QUICKSTART.hash).text == QUICKSTART.text
    path = export.folder / "materials" / "studies" / f"{QUICKSTART.hash}.toml"
    path.write_text(path.read_text() + "# changed\n")
    with pytest.raises(ExportError, match="was changed after the export"):
        open_export(export.folder).study(QUICKSTART.hash)
    path.unlink()
    with pytest.raises(ExportError, match="Can't read"):
        open_export(export.folder).study(QUICKSTART.hash)


def test_what_is_no_export_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="found none at"):
        open_export(tmp_path / "nowhere")
    with pytest.raises(ExportError, match=r"found no manifest\.json"):
        open_export(tmp_path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda told: told | {"what": "something else"}, "isn't an export's manifest"),
        (
            lambda told: told | {"version": 2, "code_version": "9.9"},
            "version 1 .* got 2, which prefstudy 9.9",
        ),
        (lambda told: told | {"form": "xlsx"}, "is damaged"),
        (lambda told: told | {"sha256": "0" * 64}, "don't add up"),
        (lambda told: told | {"tables": {"people": {}}}, "is damaged"),
        (lambda told: [], "isn't an export's manifest"),
    ],
)
def test_a_manifest_that_cannot_be_read_is_refused(
    copied: Callable[[str], Export], change: Callable[[Any], Any], said: str
) -> None:
    export = copied("csv")
    path = export.folder / "manifest.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(ExportError, match=said) as caught:
        open_export(export.folder)
    assert "\n" not in str(caught.value)


def test_a_manifest_that_is_no_json_and_a_missing_table_are_refused(copied: Callable[[str], Export]) -> None:
    export = copied("csv")
    export.path_of("queries").unlink()
    with pytest.raises(ExportError, match=r"Expected the table .*queries\.csv"):
        open_export(export.folder)
    (export.folder / "manifest.json").write_text("{")
    with pytest.raises(ExportError, match="Can't read"):
        open_export(export.folder)
