"""The command line."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import app.process  # noqa: F401  - before numpy
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
    str,
    typer.Option("--study", envvar="PREFSTUDY_STUDY", help="A study file, or the name of one that ships."),
]
DatabaseOption = Annotated[
    str,
    typer.Option(
        "--database", envvar="PREFSTUDY_DATABASE", help="Where answers are kept, e.g. sqlite:///my.db."
    ),
]

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random in it.")]


class OutputError(AppError):
    """An output file that can't be written."""


@cli.command()
def serve(
    study: StudyOption = DEFAULT_STUDY,
    database: DatabaseOption = DEFAULT_DATABASE,
    host: Annotated[str, typer.Option(envvar="PREFSTUDY_HOST", help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(envvar="PREFSTUDY_PORT", min=0, max=65535, help="Port; 0 takes a free one.")
    ] = 8000,
    workers: Annotated[
        int, typer.Option(envvar="PREFSTUDY_WORKERS", min=1, help="Processes that compute queries.")
    ] = 2,
    scheduler: Annotated[
        str | None,
        typer.Option(
            envvar="PREFSTUDY_SCHEDULER", help="Address of a running Dask scheduler to use instead."
        ),
    ] = None,
    public_url: Annotated[
        str | None,
        typer.Option(
            envvar="PREFSTUDY_PUBLIC_URL", help="Address that participants use, when behind a proxy."
        ),
    ] = None,
) -> None:
    """Serve a study; prints the link that participants open. Stop with Ctrl-C."""
    from app import wiring

    log.configure("WARNING")
    settings = wiring.ServeSettings(find_study(study), database, host, port, workers, scheduler, public_url)
    console.print(f"Starting [bold]{settings.study.name}[/] (compiling kernels on the first run) ...")
    wiring.serve(settings, lambda link: print(f"Participants open: {link}", flush=True))


@cli.command()
def replay(
    path: Annotated[
        Path, typer.Argument(help="JSON Lines of answers, or a folder that `export --format jsonl` wrote.")
    ],
    json_: JsonOption = False,
) -> None:
    """Run a scripted or exported session again, headless; fail at the first query that comes out differently.

    The first line of a script is like {"study": "quickstart", "participant": 1}; each line after it like
    {"query_index": 0, "choice": "a", "response_time_ms": 1200}.
    """
    from app import wiring
    from app.services.replay import read_scripts
    from app.services.replay import replay as replay_script

    log.configure("WARNING")
    with wiring.headless() as runtime:
        for script in read_scripts(path):
            summary = replay_script(runtime, script)
            _print_summary(summary, json_, f"{script.source}: {len(script.stored)} stored queries reproduced")


@cli.command()
def simulate(
    study: StudyOption = DEFAULT_STUDY,
    people: Annotated[int, typer.Option(min=1, help="How many simulated people.")] = 1,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the people: who they are and how they answer.")
    ] = 0,
    database: DatabaseOption = DEFAULT_DATABASE,
    out: Annotated[Path | None, typer.Option(help="Write one JSON line a person to this file.")] = None,
    json_: JsonOption = False,
) -> None:
    """Let simulated people of known weights walk a study; their sessions are kept, marked as rehearsed."""
    from app import wiring
    from app.services.rehearsal import rehearse

    log.configure("WARNING")
    definition = find_study(study)
    with wiring.headless(database) as runtime, _progress() as progress, _lines(out) as write:
        task = progress.add_task(definition.name, total=people * definition.protocol.n_queries)
        for number in range(1, people + 1):
            summary = rehearse(runtime, definition, seed, number, lambda: progress.advance(task))
            write(json.dumps(summary))
            _print_summary(summary, json_, f"alignment {summary['alignment']:.3f}")


@cli.command()
def export(
    out: Annotated[Path, typer.Argument(help="A new folder.")],
    format_: Annotated[Literal["csv", "jsonl"], typer.Option("--format", help="One file a table.")] = "csv",
    people: Annotated[Literal["real", "rehearsed", "all"], typer.Option(help="Whose sessions.")] = "real",
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Write people, queries, answers, posteriors and events as tidy tables, with the study files."""
    from app.services.export import export as export_tables
    from app.store import open_store

    with open_store(database) as store, _progress() as progress:
        task = progress.add_task("people", total=None)
        n_people = export_tables(store, out, format_, people, lambda: progress.advance(task))
    console.print(f"Wrote {n_people} people to {out}.")


@cli.command()
def migrate(database: DatabaseOption = DEFAULT_DATABASE) -> None:
    """Bring a database to this version's schema; nothing may be serving it meanwhile."""
    from app.store.migrate import upgrade

    console.print(f"The database has schema {upgrade(database)}.")


bench = typer.Typer(
    help="Measure this machine; every number is a ratio to the named alternative in the same run."
)
cli.add_typer(bench, name="bench", no_args_is_help=True)


@bench.command("query")
def bench_query(seed: SeedOption = 0, json_: JsonOption = False) -> None:
    """Time from an answer to the next query, complete, against the same work done the plain way."""
    from app.bench import query

    with _progress() as progress:
        _print_result(query.run(seed, progress), json_)


@bench.command("serve")
def bench_serve(
    people: Annotated[int, typer.Option(min=1, help="People at once.")] = 50,
    answers: Annotated[int, typer.Option(min=1, help="Answers in all.")] = 2000,
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Time from posting an answer to having the next query, many people at once, against a separate server process."""
    from app.bench import serve as serve_bench

    with _progress() as progress:
        _print_result(serve_bench.run(seed, people, answers, progress), json_)


@bench.command("published")
def bench_published(
    data: Annotated[
        Path,
        typer.Option(
            "--data", envvar="PREFSTUDY_PUBLISHED_DATA", help="Folder of the published study's JLD2 files."
        ),
    ],
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Test accuracy of each response model on the published study, fitted to training answers alone."""
    from app.bench import published

    with _progress() as progress:
        _print_result(published.run(seed, data, progress), json_)


def _progress() -> Progress:
    """Returns a progress display on stderr, so that stdout holds results alone."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
    )


@contextmanager
def _lines(path: Path | None) -> Iterator[Callable[[str], None]]:
    """Gives a function that writes a line to the file, or nowhere."""
    if path is None:
        yield lambda line: None
        return
    try:
        file = path.open("x", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Can't write {path}: {error.strerror}. Name a new file.") from error
    with file:
        yield lambda line: print(line, file=file)


def _print_result(result: dict[str, Any], is_json: bool) -> None:
    print(json.dumps(result) if is_json else json.dumps(result, indent=2))


def _print_summary(summary: dict[str, Any], is_json: bool, headline: str) -> None:
    """Prints a session: as one JSON line, or as what a person wants to see."""
    if is_json:
        print(json.dumps(summary))
        return
    out = Console()
    out.print(f"{summary['study']}, participant {summary['participant']}: {headline}", highlight=False)
    for row in summary["queries"]:
        difference = [
            a - b for a, b in zip(row["query"]["features_a"], row["query"]["features_b"], strict=True)
        ]
        values = " ".join(f"{value:+.3f}" for value in difference)
        out.print(
            f"  query {row['query_index']:3d} {row['phase']:6s} {values}  -> {row['choice']}", highlight=False
        )
    mean = " ".join(f"{value:.3f}" for value in summary["posterior"]["mean"])
    out.print(f"  posterior mean {mean}, test accuracy {summary['test_accuracy']}", highlight=False)


def main() -> None:
    """Runs the command line: errors are one line on stderr with the remedy."""
    try:
        cli()
    except (AppError, StudyCoreError) as error:
        console.print(f"[red]Error:[/] {error}", highlight=False, soft_wrap=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
