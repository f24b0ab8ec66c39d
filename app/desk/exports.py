"""Exports as one file to download: for the desk's pages and for programs."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Literal

from fastapi import Query
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from app.desk.admission import Admitted
from app.desk.parts import DeskParts
from app.services.export import ExportOptions
from app.services.export.archive import Archive
from app.store import UnknownError

ZIP = "application/zip"


class ExportWish(BaseModel):
    """What an export shall hold."""

    model_config = ConfigDict(extra="forbid")

    form: Literal["csv", "parquet", "jsonl", "psych-ds"] = Field("csv", description="What its tables are.")
    people: Literal["real", "rehearsed", "imported", "all"] = Field("real", description="Whose sessions.")
    samples: Literal["all", "last", "none"] = Field(
        "last", description="Of which posteriors the samples are in it: all, each person's last, or none."
    )
    pseudonyms: bool = Field(
        False, description="Other names, no external ids and no clock times; nobody gets a key to them."
    )


Wished = Annotated[ExportWish, Query()]


def archive(parts: DeskParts, here: Admitted, study_name: str, wish: ExportWish) -> StreamingResponse:
    """Returns an export as a zip file, and notes who has made it.

    Raises:
        UnknownError: There is no study of that name.
        ExportError: There is nobody to export, or no room.
    """
    store = parts.runtime.store
    if study_name not in {record.name for record in store.studies()}:
        raise UnknownError(f"Expected the name of a study, got '{study_name}'. The desk lists them.")
    options = ExportOptions(wish.form, wish.people, study_name, wish.samples, wish.pseudonyms)
    name = f"{study_name}-{wish.form}-{datetime.now(UTC):%Y-%m-%d}"
    packed = Archive(store, options, name)
    store.desk.record(here.name, "exported", study_name, wish.model_dump() | {"n_people": packed.n_people})
    headers = {"Content-Disposition": f'attachment; filename="{name}.zip"'}
    return StreamingResponse(iter(packed), headers=headers, media_type=ZIP)
