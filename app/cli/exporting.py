"""Commands that take data out of a database."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from app.cli.options import DatabaseOption
from app.settings import DEFAULT_DATABASE
from app.terminal import console, counter, new_progress


def export(
    out: Annotated[Path, typer.Argument(help="A new folder.")],
    format_: Annotated[
        Literal["csv", "parquet", "jsonl", "psych-ds"],
        typer.Option("--format", help="One file a table; psych-ds is CSV in that standard's folders."),
    ] = "csv",
    people: Annotated[
        Literal["real", "rehearsed", "imported", "all"], typer.Option(help="Whose sessions.")
    ] = "real",
    study: Annotated[
        str | None, typer.Option(help="Name of one study, in all its versions; all studies unless told.")
    ] = None,
    samples: Annotated[
        Literal["all", "last", "none"],
        typer.Option(
            help="Posterior samples: of all queries, which `replay` needs on another kind of computer and which may be "
            "gigabytes; each person's last; or none."
        ),
    ] = "last",
    clips: Annotated[
        bool,
        typer.Option(
            "--clips", help="Build the animations that people saw as well: some 200 kB and 10 ms a query."
        ),
    ] = False,
    pseudonyms: Annotated[
        Path | None,
        typer.Option(
            metavar="KEYFILE",
            help="Name people by pseudonyms, and leave out their external ids and clock times. The key goes to this "
            "new file; keep it apart. What people wrote into free texts stays: read it before you publish it.",
        ),
    ] = None,
    keep_times: Annotated[
        bool, typer.Option("--keep-times", help="Leave clock times as they are, also with pseudonyms.")
    ] = False,
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Write everything that was recorded as tidy tables that describe themselves, with studies, texts and models.

    The study can go on meanwhile. Either all of it is written or nothing.
    """
    from app.continuation import build_clips
    from app.services.export import ExportOptions
    from app.services.export import export as export_tables
    from app.store import open_existing_store

    options = ExportOptions(format_, people, study, samples, pseudonyms is not None, pseudonyms, keep_times)
    with open_existing_store(database) as store, new_progress() as progress:
        n_people = export_tables(
            store, out, options, counter(progress, "people"), build_clips if clips else None
        )
    console.print(f"Wrote {n_people} people to {out}.")
