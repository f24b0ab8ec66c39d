"""What is to be exported, and how."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.services.export.layout import Form
from app.store import Source

People = Literal["real", "rehearsed", "imported", "all"]
Samples = Literal["all", "last", "none"]

SOURCES = {"real": Source.JOINED, "rehearsed": Source.REHEARSED, "imported": Source.IMPORTED}


@dataclass(frozen=True)
class ExportOptions:
    """What is to be exported, and how.

    Attributes:
        form: `csv`, `parquet`, `jsonl`, or `psych-ds`, which is CSV in that standard's folders.
        people: Real ones, who joined here, rehearsed or imported ones, or all.
        study: Name of the study, in all its versions; None for all studies.
        samples: Of which posteriors the samples are written: all, each person's last, or none.
        has_pseudonyms: Whether people get other names, and what others know them by is left out.
        key_file: Where the key to the pseudonyms goes; None if nobody is to have it.
        keeps_times: Whether times stay as they are where people have pseudonyms; otherwise they count from each
            person's own beginning.
    """

    form: Form = "csv"
    people: People = "real"
    study: str | None = None
    samples: Samples = "last"
    has_pseudonyms: bool = False
    key_file: Path | None = None
    keeps_times: bool = False
