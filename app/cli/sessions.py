"""Walking through whole sessions without a browser: `simulate`."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Any

import typer

from app import log
from app.cli.options import DatabaseOption, SchedulerOption, StudyOption
from app.process import n_cores
from app.settings import DEFAULT_DATABASE, DEFAULT_STUDY, find_study
from app.terminal import JsonOption, build_bank, new_progress, print_summary


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
    declining: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of them who don't consent, where a study asks.")
    ] = 0.0,
    leaving: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of them who stop at some query.")
    ] = 0.0,
    careless: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of them who answer everything at random, and fast.")
    ] = 0.0,
    database: DatabaseOption = DEFAULT_DATABASE,
    out: Annotated[
        Path | None,
        typer.Option(help="Write one row a person and query to this file: .csv, .parquet or .jsonl."),
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
    """Let simulated people of known weights walk a whole study, its conditions and exclusions among it.

    Their sessions are kept, marked as rehearsed: exports leave them out unless told otherwise.
    """
    from app import wiring
    from app.services.rehearsal import rehearse_all
    from app.services.rehearsal_table import new_rehearsal_table
    from app.services.rehearsed_person import Crowd, Manners
    from study_core.participants import Habits

    log.configure("WARNING")
    definition = find_study(study)
    build_bank(definition)
    habits = Habits(drift, side_bias, unsure_rate, hidden_feature, hidden_weight if hidden_feature else 0.0)
    crowd = Crowd(seed, people, habits, rationality, lapse_rate, Manners(declining, leaving, careless))
    n_workers = min(workers or n_cores(), people)
    # While one person's answer is being stored, another's next query is computed.
    n_at_once = 1 if n_workers == 1 else 2 * n_workers
    with ExitStack() as stack:
        add_rows = stack.enter_context(new_rehearsal_table(out, definition)) if out else None
        runtime = stack.enter_context(wiring.headless(database, n_workers, scheduler))
        progress = stack.enter_context(new_progress())
        task = progress.add_task(definition.name, total=people * definition.n_queries)
        rehearsals = rehearse_all(runtime, definition, crowd, n_at_once, lambda: progress.advance(task))
        for rehearsal in stack.enter_context(closing(rehearsals)):
            if add_rows is not None:
                add_rows(rehearsal.rows)
            headline = _headline(rehearsal.summary)
            print_summary(rehearsal.summary, json_, headline, has_queries=people == 1)


def _headline(summary: dict[str, Any]) -> str:
    condition = f"condition {summary['condition']}, " if summary["condition"] else ""
    found = "asked nothing" if summary["alignment"] is None else f"alignment {summary['alignment']:.3f}"
    return f"{condition}{summary['ending']}, {found}"
