"""Running recorded sessions again: `replay`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from zipfile import is_zipfile

import typer
from rich.console import Console

from app import log
from app.errors import AppError
from app.machine import machine
from app.terminal import JsonOption, build_bank, new_progress, print_summary, warn

if TYPE_CHECKING:
    from app.services.replay import PersonReplayed, Survey


class PackedExportError(AppError):
    """A zip file in the place of a folder."""


def replay(
    path: Annotated[Path, typer.Argument(help="A folder that `export` wrote, or JSON Lines of answers.")],
    steps: Annotated[
        bool,
        typer.Option(
            "--steps",
            help="Verify each stored step alone, as is done anyway for what another type of processor has computed.",
        ),
    ] = False,
    json_: JsonOption = False,
) -> None:
    """Derive an export's queries again from the export alone, or run a scripted session; fail at the first difference.

    An export's rows are compared with their digests first, then with the logs. Queries are derived again to the last
    bit. Where another type of processor computed them, that can't be: then each step is verified alone, against the
    stored samples, for which the export must have been written with --samples all.

    Who was asked nothing, was imported, or started from somebody who has been deleted, is left out, and named.

    The first line of a script is like {"study": "quickstart", "participant": 1}; each line after it like
    {"query_index": 0, "choice": "a", "response_time_ms": 1200}.
    """
    log.configure("WARNING")
    if path.is_dir():
        _replay_export(path, steps, json_)
    elif is_zipfile(path):
        raise PackedExportError(f"{path} is packed. Unpack it, then replay the folder that is in it.")
    else:
        _replay_script(path, json_)


def _replay_script(path: Path, is_json: bool) -> None:
    from app import wiring
    from app.services.replay import read_script, replay_script

    script = read_script(path)
    build_bank(script.study)
    with wiring.headless() as runtime:
        print_summary(replay_script(runtime, script), is_json, script.source)


def _replay_export(folder: Path, by_steps: bool, is_json: bool) -> None:
    from app import wiring
    from app.services.export import open_export
    from app.services.replay import Reproduction, survey

    export = open_export(folder)
    with new_progress() as progress:
        n_rows = sum(export.manifest.n_rows.values())
        task = progress.add_task("rows", total=n_rows)
        export.check_digests(lambda n: progress.advance(task, n))
    known = survey(export)
    warn(known.left_out)
    for study in known.studies:
        build_bank(study)
    with wiring.headless() as runtime, new_progress() as progress:
        task = progress.add_task("queries", total=known.n_queries)
        people = Reproduction(runtime, export, by_steps).run(lambda: progress.advance(task))
        for person in people:
            _print_person(person, is_json)
    _print_end(folder, n_rows, known, is_json)


def _print_person(person: PersonReplayed, is_json: bool) -> None:
    if is_json:
        told = {
            "study": person.study.name,
            "study_hash": person.study.hash,
            "participant": person.participant,
            "way": person.way,
            "queries": person.n_queries,
            "other_machines": list(person.other_machines),
            "not_verified": dict(sorted(person.not_verified.items())),
        }
        print(json.dumps(told))
        return
    out = Console(soft_wrap=True, highlight=False)
    who = f"{person.study.name}, participant {person.participant}"
    if person.way == "derived":
        out.print(f"{who}: {person.n_queries} stored queries reproduced to the last bit")
        return
    out.print(f"{who}: each step of {person.n_queries} stored queries verified alone")
    for other in person.other_machines:
        out.print(f"  computed on {other}; this is {machine()}")
    for what, how_often in sorted(person.not_verified.items()):
        out.print(f"  not verified: {what} ({how_often})")


def _print_end(folder: Path, n_rows: int, known: Survey, is_json: bool) -> None:
    if not is_json:
        out = Console(soft_wrap=True, highlight=False)
        out.print(f"{folder}: {n_rows} rows as they were exported, {known.n_people} people reproduced")
