"""The command line: every command, and how errors are told."""

from __future__ import annotations

import sys

import typer
from rich.markup import escape

import app.process  # noqa: F401  - before numpy
from app.bench.cli import bench
from app.cli.data import backup, delete, forget, import_, migrate, restore
from app.cli.experimenters import experimenter
from app.cli.exporting import export
from app.cli.learning import appendix, evaluate, report, train
from app.cli.reproducing import replay
from app.cli.serving import link, serve
from app.cli.sessions import simulate
from app.cli.studies import check, new, settings
from app.errors import AppError
from app.terminal import console
from study_core.errors import StudyCoreError

cli = typer.Typer(
    name="prefstudy",
    help="Run studies in which people teach a machine what they prefer.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (
    *(new, check, settings, serve, link, simulate, replay, export, delete),
    *(backup, restore, migrate, forget, train, evaluate, report, appendix),
):
    cli.command()(command)
cli.command("import")(import_)
cli.add_typer(experimenter, name="experimenter", no_args_is_help=True)
cli.add_typer(bench, name="bench", no_args_is_help=True)


@cli.callback()
def root() -> None:
    """Run studies in which people teach a machine what they prefer."""


def main() -> None:
    """Runs the command line: errors are one line on stderr with the remedy."""
    try:
        cli()
    except (AppError, StudyCoreError) as error:
        console.print(f"[red]Error:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(1)
