"""The command line."""

from __future__ import annotations

import app.process  # noqa: F401  - before numpy

import sys
from typing import Annotated

import typer
from rich.console import Console

from app import log
from app.errors import AppError
from app.settings import DEFAULT_DATABASE, DEFAULT_STUDY, find_study
from study_core.errors import StudyCoreError

cli = typer.Typer(
    name="prefstudy",
    help="Run studies in which people teach a machine what they prefer.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
console = Console(stderr=True)



@cli.callback()
def root() -> None:
    """Run studies in which people teach a machine what they prefer."""


StudyOption = Annotated[
    str, typer.Option("--study", envvar="PREFSTUDY_STUDY", help="A study file, or the name of one that ships.")
]
DatabaseOption = Annotated[
    str, typer.Option("--database", envvar="PREFSTUDY_DATABASE", help="Where answers are kept, e.g. sqlite:///my.db.")
]


@cli.command()
def serve(
    study: StudyOption = DEFAULT_STUDY,
    database: DatabaseOption = DEFAULT_DATABASE,
    host: Annotated[str, typer.Option(envvar="PREFSTUDY_HOST", help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(envvar="PREFSTUDY_PORT", help="Port; 0 takes a free one.")] = 8000,
    workers: Annotated[
        int, typer.Option(envvar="PREFSTUDY_WORKERS", min=1, help="Processes that compute queries.")
    ] = 2,
    scheduler: Annotated[
        str | None,
        typer.Option(envvar="PREFSTUDY_SCHEDULER", help="Address of a running Dask scheduler to use instead."),
    ] = None,
    public_url: Annotated[
        str | None,
        typer.Option(envvar="PREFSTUDY_PUBLIC_URL", help="Address that participants use, when behind a proxy."),
    ] = None,
) -> None:
    """Serve a study; prints the link that participants open. Stop with Ctrl-C."""
    from app import wiring

    log.configure("WARNING")
    settings = wiring.ServeSettings(
        find_study(study), database, host, port, workers, scheduler, public_url
    )
    console.print(f"Starting [bold]{settings.study.name}[/] (compiling kernels on the first run) ...")
    wiring.serve(settings, lambda link: print(f"Participants open: {link}", flush=True))


def main() -> None:
    """Runs the command line: errors are one line on stderr with the remedy."""
    try:
        cli()
    except (AppError, StudyCoreError) as error:
        console.print(f"[red]Error:[/] {error}", highlight=False, soft_wrap=True)
        sys.exit(1)
