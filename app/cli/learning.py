"""Commands that learn from people, and say how well: `train`, `evaluate` and `report`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.table import Column, Table

from app import log
from app.cli.options import DatabaseOption, SchedulerOption
from app.process import n_cores
from app.settings import DEFAULT_DATABASE
from app.terminal import JsonOption, SeedOption, console, new_progress, warn

if TYPE_CHECKING:
    from app.store import Store


PeopleOption = Annotated[
    Literal["real", "rehearsed"],
    typer.Option(help="Whose sessions: real people's, or those that tried the study out."),
]


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
        learn_populations(store, study)


def evaluate(
    study: Annotated[
        str | None,
        typer.Option("--study", help="Only people of the study of this name; everyone unless told."),
    ] = None,
    people: PeopleOption = "real",
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
        evaluated = people_to_evaluate(store, study, people == "rehearsed")
    warn(evaluated.left_out)
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


def report(
    out: Annotated[Path, typer.Argument(help="A new file, such as report.html.")],
    study: Annotated[
        str | None,
        typer.Option("--study", help="Only people of the study of this name; everyone unless told."),
    ] = None,
    people: PeopleOption = "real",
    database: DatabaseOption = DEFAULT_DATABASE,
    seed: SeedOption = 0,
) -> None:
    """Write what was learned from people as one web page: predictors compared, the paper's figures, the method.

    Where real people took part here, how the study was run stands at its end, as `appendix` writes it.
    """
    from app.report import findings
    from app.report.appendix.document import appendix_of
    from app.report.report import new_file, write
    from app.services.evaluation import people_to_evaluate
    from app.store import open_existing_store

    log.configure("WARNING")
    with open_existing_store(database) as store:
        evaluated = people_to_evaluate(store, study, people == "rehearsed")
        how_it_was_run = appendix_of(store, sorted({each.name for each in evaluated.studies.values()}))
    warn(evaluated.left_out)
    with new_file(out) as file, new_progress() as progress:
        shown = progress.add_task("report", total=findings.n_steps(len(evaluated.people)))
        found = findings.find(seed, evaluated, n_cores(), lambda: progress.advance(shown))
        file.write(write(found, how_it_was_run))
    console.print(f"Wrote {out}.")


def appendix(
    out: Annotated[Path, typer.Argument(help="A new file, such as appendix.md.")],
    study: Annotated[str, typer.Option("--study", help="Name of the study.")],
    people: PeopleOption = "real",
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Write what a paper has to report about a study: people, payment, exclusions, demographics, timing, software."""
    from app.new_file import open_new
    from app.report.appendix.document import appendix_sections, as_markdown
    from app.store import Source, open_existing_store

    source = Source.JOINED if people == "real" else Source.REHEARSED
    with open_existing_store(database) as store:
        title = f"Reporting appendix: {study}{' (rehearsed people)' if source is Source.REHEARSED else ''}"
        text = as_markdown(title, appendix_sections(store, study, source))
    with open_new(out) as file:
        file.write(text)
    console.print(f"Wrote {out}.")


def learn_populations(store: Store, study_name: str | None) -> None:
    """Learns what people have in common wherever that isn't up to date, and says so."""
    from app import wiring

    with wiring.populations(store) as populations:
        for study in populations.missing(study_name):
            print(f"Learned what {populations.fit(study)} people of {study.name} have in common.")


def _print_table(columns: Sequence[str], rows: Sequence[Sequence[Any]], emphasised: str = "") -> None:
    """Prints numbers to three places; the row that begins with what is emphasised is bold."""
    table = Table(Column(columns[0], no_wrap=True), *columns[1:])
    for row in rows:
        cells = [f"{value:.3f}" if isinstance(value, float) else str(value) for value in row]
        table.add_row(*cells, style="bold" if row[0] == emphasised else "")
    Console().print(table)
