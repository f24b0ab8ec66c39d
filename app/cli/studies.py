"""Commands that set a study up: `new` and `check`."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path
from secrets import randbelow
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from typer.core import TyperOption

from app.errors import AppError
from app.new_file import open_new
from app.settings import STATIC, find_study
from app.terminal import JsonOption, build_bank, console
from study_core.errors import StudyError
from study_core.reference import settings_table
from study_core.section import NAME
from study_core.toml_lines import line_of


class StudyNameError(AppError):
    """A name that a study can't have."""


def new(
    name: Annotated[str, typer.Argument(help="What to call it: small letters, digits and hyphens.")],
) -> None:
    """Write a commented study file NAME.toml, ready to be changed and served."""
    if not re.fullmatch(NAME, name):
        raise StudyNameError(
            f"Expected a name of small letters, digits and hyphens, such as my-study, got {name!r}."
        )
    path = Path(f"{name}.toml")
    template = (STATIC / "new" / "study.toml").read_text(encoding="utf-8")
    with open_new(path) as file:
        file.write(template.replace("NAME", name).replace("SEED", str(randbelow(1_000_000))))
    print(f"Wrote {path}. Next: prefstudy check {path}")


def check(
    study: Annotated[
        str, typer.Argument(metavar="FILE", help="A study file, or the name of one that ships.")
    ],
    json_: JsonOption = False,
) -> None:
    """Say what a study will do: its queries, time, cost and compute; or what is wrong with its file, and where."""
    from app.continuation import continue_session
    from app.services.outlook import advice, compute, outlook, seconds_per_query

    try:
        checked = find_study(study)
    except StudyError as error:
        _print_problems(study, error)
        raise typer.Exit(1) from error
    build_bank(checked)
    with console.status("Timing a few queries ..."):
        seconds = seconds_per_query(checked, continue_session)
    found = asdict(outlook(checked)) | compute(checked, seconds)
    if json_:
        print(json.dumps(found))
        return
    table = Table(
        title=f"{checked.name}: {checked.title(checked.languages[0])}",
        show_header=False,
        title_justify="left",
    )
    for name, value in found.items():
        table.add_row(name.replace("_", " "), _shown(value))
    Console().print(table)
    for note in advice(checked):
        console.print(f"[yellow]Note:[/] {escape(note)}", highlight=False)


def settings() -> None:
    """Print every setting: of study files, and of the server, also as environment variables. Markdown."""
    print(
        f"# Every setting\n\n{_WHERE_FROM}\n\n## Study files\n\n{settings_table()}\n## The server\n\n{_server_table()}"
    )


_WHERE_FROM = (
    """`prefstudy settings` prints this page: it is made from what reads a study file and the command line."""
)


def _server_table() -> str:
    from app.cli.serving import serve

    serving = typer.Typer()
    serving.command()(serve)
    rows = [
        f"| `{option.opts[0]}` | `{option.envvar}` | {_without(option.default)} | {option.help} |"
        for option in typer.main.get_command(serving).params
        if isinstance(option, TyperOption) and option.envvar
    ]
    return "\n".join(["| option | variable | without it | meaning |", "| --- | --- | --- | --- |", *rows])


def _without(default: object) -> str:
    return "" if default is None else f"`{default}`"


def _print_problems(study: str, error: StudyError) -> None:
    """Prints all that is wrong, each with its line in the file."""
    path = Path(study) if Path(study).is_file() else None
    if path is None or not error.problems:
        raise error
    text = path.read_text(encoding="utf-8")
    for problem in error.problems:
        line = line_of(text, problem.location)
        where = f"{path}:{line}" if line else str(path)
        console.print(f"[red]{escape(where)}:[/] {escape(problem.message)}", highlight=False, soft_wrap=True)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{n} {name}" for name, n in value.items() if n)
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value)) or "none"
    return "not said" if value is None else str(value)
