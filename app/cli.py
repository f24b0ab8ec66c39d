"""The command line."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.table import Column, Table

import app.process  # noqa: F401  - before numpy
from app import log
from app.bench.cli import bench
from app.errors import AppError
from app.process import n_cores
from app.settings import DEFAULT_DATABASE, DEFAULT_STUDY, find_study
from app.terminal import JsonOption, SeedOption, build_bank, console, counter, new_progress
from study_core.errors import StudyCoreError

if TYPE_CHECKING:
    from app.store import Store

cli = typer.Typer(
    name="prefstudy",
    help="Run studies in which people teach a machine what they prefer.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
cli.add_typer(bench, name="bench", no_args_is_help=True)


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

SchedulerOption = Annotated[
    str | None,
    typer.Option(envvar="PREFSTUDY_SCHEDULER", help="Address of a running Dask scheduler to use instead."),
]


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
    scheduler: SchedulerOption = None,
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
    build_bank(settings.study)
    console.print(f"Starting [bold]{settings.study.name}[/] (compiling kernels on the first run) ...")
    wiring.serve(settings, lambda link: print(f"Participants open: {link}", flush=True))


@cli.command()
def link(
    external_ids: Annotated[
        list[str],
        typer.Argument(metavar="ID...", help="Whom the links are for: any names that tell them apart."),
    ],
    study: StudyOption = DEFAULT_STUDY,
    database: DatabaseOption = DEFAULT_DATABASE,
    base_url: Annotated[
        str, typer.Option(help="Address at which participants reach the server.")
    ] = "http://127.0.0.1:8000",
) -> None:
    """Print each person's own link: it lets them in, and back in, from any browser.

    A link holds for one study and one database, also while that is being served.
    """
    from app.services.links import personal_link
    from app.store import open_store

    name = find_study(study).name
    with open_store(database) as store:
        for external_id in external_ids:
            print(personal_link(store, name, external_id, base_url))


@cli.command()
def replay(
    path: Annotated[
        Path, typer.Argument(help="JSON Lines of answers, or a folder that `export --format jsonl` wrote.")
    ],
    json_: JsonOption = False,
) -> None:
    """Run a scripted or exported session again, headless; fail at the first query that comes out differently.

    Who was asked nothing, or started from somebody who has been deleted, is left out, and named.

    The first line of a script is like {"study": "quickstart", "participant": 1}; each line after it like
    {"query_index": 0, "choice": "a", "response_time_ms": 1200}.
    """
    from app import wiring
    from app.services.replay import read_scripts
    from app.services.replay import replay as replay_script

    log.configure("WARNING")
    with wiring.headless() as runtime:
        for script in read_scripts(path):
            if script.hindrance:
                _warn([script.hindrance])
                continue
            build_bank(script.study)
            summary = replay_script(runtime, script)
            n_stored = len(script.stored or ())
            _print_summary(summary, json_, f"{script.source}: {n_stored} stored queries reproduced")


@cli.command()
def simulate(
    study: StudyOption = DEFAULT_STUDY,
    people: Annotated[int, typer.Option(min=1, help="How many simulated people.")] = 1,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the people: who they are and how they answer.")
    ] = 0,
    rationality: Annotated[
        float | None, typer.Option(min=1e-6, max=1e6, help="Their beta; the study's own unless told.")
    ] = None,
    lapse_rate: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=0.999, help="Share of answers they give at random; the study's unless told."
        ),
    ] = None,
    drift: Annotated[
        float,
        typer.Option(
            min=0.0, max=3.15, help="Angle in radians by which their taste moves at every query (r.m.s.)."
        ),
    ] = 0.0,
    side_bias: Annotated[
        float,
        typer.Option(
            min=-100.0, max=100.0, help="What is added to their log-odds of what stands first on the screen."
        ),
    ] = 0.0,
    unsure_rate: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Share of queries they can't tell, where a study offers that."),
    ] = 0.0,
    hidden_feature: Annotated[
        str | None,
        typer.Option(help="A rich feature of the domain that they care for as well, such as 'side'."),
    ] = None,
    hidden_weight: Annotated[
        float, typer.Option(min=-100.0, max=100.0, help="How much, per unit of that feature.")
    ] = 1.0,
    database: DatabaseOption = DEFAULT_DATABASE,
    out: Annotated[
        Path | None, typer.Option(help="Write one row a person and query to this file: .csv or .jsonl.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, help="Processes that compute; all cores unless told. The results don't depend on it."
        ),
    ] = None,
    scheduler: SchedulerOption = None,
    json_: JsonOption = False,
) -> None:
    """Let simulated people of known weights walk a study; their sessions are kept, marked as rehearsed."""
    from app import wiring
    from app.services.rehearsal import Crowd, rehearse_all
    from app.services.table import new_table
    from study_core.participants import Habits

    log.configure("WARNING")
    definition = find_study(study)
    build_bank(definition)
    habits = Habits(drift, side_bias, unsure_rate, hidden_feature, hidden_weight if hidden_feature else 0.0)
    crowd = Crowd(seed, people, habits, rationality, lapse_rate)
    n_workers = min(workers or n_cores(), people)
    # While one person's answer is being stored, another's next query is computed.
    n_at_once = 1 if n_workers == 1 else 2 * n_workers
    with ExitStack() as stack:
        table = stack.enter_context(new_table(out)) if out else None
        runtime = stack.enter_context(wiring.headless(database, n_workers, scheduler))
        progress = stack.enter_context(new_progress())
        task = progress.add_task(definition.name, total=people * definition.n_queries)
        rehearsals = rehearse_all(runtime, definition, crowd, n_at_once, lambda: progress.advance(task))
        for rehearsal in stack.enter_context(closing(rehearsals)):
            if table is not None:
                for row in rehearsal.rows:
                    table.write(row)
            headline = f"alignment {rehearsal.summary['alignment']:.3f}"
            _print_summary(rehearsal.summary, json_, headline, has_queries=people == 1)


@cli.command()
def export(
    out: Annotated[Path, typer.Argument(help="A new folder.")],
    format_: Annotated[Literal["csv", "jsonl"], typer.Option("--format", help="One file a table.")] = "csv",
    people: Annotated[
        Literal["real", "rehearsed", "imported", "all"], typer.Option(help="Whose sessions.")
    ] = "real",
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Write people, queries, answers, posteriors and events as tidy tables, with the study files."""
    from app.services.export import export as export_tables
    from app.store import open_existing_store

    with open_existing_store(database) as store, new_progress() as progress:
        task = progress.add_task("people", total=None)
        n_people = export_tables(store, out, format_, people, lambda: progress.advance(task))
    console.print(f"Wrote {n_people} people to {out}.")


@cli.command("import")
def import_(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of the published study's JLD2 files.")
    ],
    database: DatabaseOption = DEFAULT_DATABASE,
    json_: JsonOption = False,
) -> None:
    """Take the published study's people into a database, as finished sessions marked as imported.

    Any subset of the people will do. All files are read before anything is stored; somebody who is there already stays
    as they are.
    """
    from app.services.published import import_person, read_people
    from app.store import open_store

    with new_progress() as progress:
        people = read_people(directory, counter(progress, "people"))
    with open_store(database) as store:
        for person in people:
            done = import_person(store, person)
            if json_:
                print(json.dumps(asdict(done)))
                continue
            became = (
                f"session {done.session_id}" if done.session_id else "was imported before; nothing changed"
            )
            answers = f"{done.n_active} active and {done.n_test} test answers"
            print(f"person {done.number:2d}: {answers}; {became}")


@cli.command()
def train(
    study: Annotated[
        str | None,
        typer.Option("--study", help="Only people of the study of this name; everyone unless told."),
    ] = None,
    database: DatabaseOption = DEFAULT_DATABASE,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, help="Processes that train; all cores unless told. The results don't depend on it."
        ),
    ] = None,
    scheduler: SchedulerOption = None,
) -> None:
    """Train the model of everyone who has finished and has none, rehearsed people apart.

    Where a study starts from the people before, what they have in common is learned again too, if it isn't up to date.
    `serve` does the same by itself whenever somebody finishes.
    """
    from app import wiring
    from app.store import open_existing_store

    log.configure("WARNING")
    with wiring.training(database, workers or n_cores(), scheduler) as trainer, new_progress() as progress:
        missing = trainer.missing(study)
        task = progress.add_task("people", total=len(missing))
        trainer.train(missing, lambda: progress.advance(task))
    whom = f" of {study}" if study else ""
    done = f"Trained the models of {len(missing)} people{whom}."
    print(done if missing else f"Nobody{whom} with enough answers lacks a model.")
    with open_existing_store(database) as store:
        _learn_populations(store, study)


def _learn_populations(store: Store, study_name: str | None) -> None:
    """Learns what people have in common wherever that isn't up to date, and says so."""
    from app import wiring

    with wiring.populations(store) as populations:
        for study in populations.missing(study_name):
            print(f"Learned what {populations.fit(study)} people of {study.name} have in common.")


@cli.command()
def evaluate(
    study: Annotated[
        str | None,
        typer.Option("--study", help="Only people of the study of this name; everyone unless told."),
    ] = None,
    database: DatabaseOption = DEFAULT_DATABASE,
    new_person: Annotated[
        bool,
        typer.Option(
            "--new-person",
            help="Also how well somebody new is predicted, by how much they have answered: "
            "two minutes for ten people, eight for twenty.",
        ),
    ] = False,
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Compare predictors of people's answers: fitted to active answers, scored on the common test answers."""
    from app.report import findings, table
    from app.services.evaluation import people_to_evaluate
    from app.store import open_existing_store

    log.configure("WARNING")
    with open_existing_store(database) as store:
        evaluated = people_to_evaluate(store, study)
    _warn(evaluated.left_out)
    with new_progress() as progress:
        curves = {}
        if new_person:
            task = progress.add_task("somebody new", total=findings.n_curve_steps(len(evaluated.people)))
            curves = findings.new_person_curves(seed, evaluated, lambda: progress.advance(task))
        shown = progress.add_task("predictors", total=findings.n_fits())
        comparison = findings.compare_all(seed, evaluated, n_cores(), lambda: progress.advance(shown))
    accuracy = findings.accuracies(comparison, findings.trial_accuracies(evaluated, comparison))
    result = table.as_json(seed, evaluated, comparison, accuracy, curves)
    if json_:
        print(json.dumps(result))
        return
    _print_table(table.columns(), table.rows(result), emphasised=result["recommended"])
    print(f"Recommended from active answers alone: {result['recommended']}")
    if new_person:
        print("Accuracy for somebody new, by number of own answers:")
        _print_table(table.new_person_columns(), table.new_person_rows(result))


@cli.command()
def report(
    out: Annotated[Path, typer.Argument(help="A new file, such as report.html.")],
    study: Annotated[
        str | None,
        typer.Option("--study", help="Only people of the study of this name; everyone unless told."),
    ] = None,
    database: DatabaseOption = DEFAULT_DATABASE,
    seed: SeedOption = 0,
) -> None:
    """Write what was learned from people as one web page: predictors compared, the paper's figures, the method."""
    from app.report import findings
    from app.report.report import new_file, write
    from app.services.evaluation import people_to_evaluate
    from app.store import open_existing_store

    log.configure("WARNING")
    with open_existing_store(database) as store:
        evaluated = people_to_evaluate(store, study)
    _warn(evaluated.left_out)
    with new_file(out) as file, new_progress() as progress:
        shown = progress.add_task("report", total=findings.n_steps(len(evaluated.people)))
        file.write(write(findings.find(seed, evaluated, n_cores(), lambda: progress.advance(shown))))
    console.print(f"Wrote {out}.")


def _warn(left_out: list[str]) -> None:
    for reason in left_out:
        console.print(f"[yellow]Left out:[/] {reason}", highlight=False, soft_wrap=True)


@cli.command()
def delete(
    person_id: Annotated[str, typer.Argument(help="The person's id, as `export` writes it.")],
    database: DatabaseOption = DEFAULT_DATABASE,
    yes: Annotated[bool, typer.Option("--yes", help="Don't ask.")] = False,
) -> None:
    """Delete a person for good: answers, posteriors, measures, their models, and every model that learned from them.

    What the others have in common is learned again. Their id and the time of deletion stay.
    Copies that `migrate` or you have made are not touched.
    """
    from app.services.evaluation import number
    from app.services.people import person
    from app.store import open_existing_store

    with open_existing_store(database) as store:
        record = store.session(person_id)
        name = store.study_name(record.study_hash)
        its_number = number(person(store, record))
        who = f"{record.source} person {its_number} of {name} ({store.n_answers(person_id)} answers)"
        if not yes:
            typer.confirm(f"Delete {who} for good?", abort=True, err=True)
        done = store.delete_session(person_id)
        models = f"{done.n_personal_models} personal and {done.n_shared_models} shared models"
        print(f"Deleted {who}, with {models}.")
        _learn_populations(store, name)
    if not done.is_wiped:
        console.print(
            "[yellow]The database's files may still hold traces:[/] another program reads them or keeps them. "
            "Stop whoever reads a SQLite file, then run VACUUM on it.",
            highlight=False,
        )


@cli.command()
def migrate(database: DatabaseOption = DEFAULT_DATABASE) -> None:
    """Bring a database to this version's schema; nothing may be serving it meanwhile.

    A SQLite file is copied first, next to it.
    """
    from app.store.migrate import upgrade

    done = upgrade(database)
    if done.before == done.after:
        print(f"The database has schema {done.after} already; nothing changed.")
    elif done.before is None:
        print(f"Created the database with schema {done.after}.")
    else:
        copy = f" A copy of what it was is in {done.backup}." if done.backup else ""
        print(f"Upgraded the database from schema {done.before} to {done.after}.{copy}")


def _print_table(columns: Sequence[str], rows: Sequence[Sequence[Any]], emphasised: str = "") -> None:
    """Prints numbers to three places; the row that begins with what is emphasised is bold."""
    table = Table(Column(columns[0], no_wrap=True), *columns[1:])
    for row in rows:
        cells = [f"{value:.3f}" if isinstance(value, float) else str(value) for value in row]
        table.add_row(*cells, style="bold" if row[0] == emphasised else "")
    Console().print(table)


def _print_summary(summary: dict[str, Any], is_json: bool, headline: str, has_queries: bool = True) -> None:
    """Prints a session: as one JSON line, or as what a person wants to see, query by query unless there are many."""
    if is_json:
        print(json.dumps(summary))
        return
    out = Console()
    out.print(f"{summary['study']}, participant {summary['participant']}: {headline}", highlight=False)
    for row in summary["queries"] if has_queries else ():
        difference = [
            a - b for a, b in zip(row["query"]["features_a"], row["query"]["features_b"], strict=True)
        ]
        values = " ".join(f"{value:+.3f}" for value in difference)
        out.print(
            f"  query {row['query_index']:3d} {row['phase']:8s} {values}  -> {row['choice']}", highlight=False
        )
    if summary["posterior"] is not None:
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
