"""The bench of exports, with few people and few answers."""

from __future__ import annotations

import pytest
from rich.progress import Progress

from app.bench import export
from app.bench.report import BenchError


@pytest.mark.slow
def test_every_form_is_compared_with_the_plain_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(export, "_N_ACTIVE", 4)
    monkeypatch.setattr(export, "_N_TEST", 2)
    with Progress(disable=True) as progress:
        found = export.run(0, 8, progress)
    # A log has its beginning, and a query and an answer six times; posteriors come with the active queries.
    n_rows = 8 * (1 + 6 + 6 + 5 + 13)
    for form in ("csv", "parquet", "jsonl"):
        assert found[form]["rows"] == n_rows
        assert found[form]["rows_per_s"] > 0
        assert found[form]["speed_ratio_to_plain"] > 0
        assert found[form]["peak_ratio_to_a_quarter"] > 0


def test_too_few_people_are_refused() -> None:
    with Progress(disable=True) as progress, pytest.raises(BenchError, match="at least 4 people"):
        export.run(0, 3, progress)
