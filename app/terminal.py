"""What every command of the command line shares: options, progress, and how results are printed."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from study_core.study import Study

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random in it.")]

console = Console(stderr=True)


def new_progress() -> Progress:
    """Returns a progress display on stderr, so that stdout holds results alone."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
    )


def counter(progress: Progress, description: str) -> Callable[[int, int], None]:
    """Returns what shows how much is done; nothing is shown before it is called."""
    tasks: list[TaskID] = []

    def show(done: int, total: int) -> None:
        if not tasks:
            tasks.append(progress.add_task(description, total=total))
        progress.update(tasks[0], completed=done)

    return show


def build_bank(study: Study) -> None:
    """Builds the bank of a study that uses one, if this machine has none yet, and shows how far it is."""
    from study_core.bank import open_bank

    if any(arm.uses_bank for arm in study.arms):
        with new_progress() as progress:
            open_bank(study.domain, counter(progress, "bank of drives"))


def warn(left_out: Sequence[str]) -> None:
    """Says who was left out of something, each with the reason."""
    for reason in left_out:
        console.print(f"[yellow]Left out:[/] {escape(reason)}", highlight=False, soft_wrap=True)


def print_result(result: dict[str, Any], is_json: bool) -> None:
    """Prints what was measured: on one line, or to be read."""
    print(json.dumps(result) if is_json else json.dumps(result, indent=2))


def print_summary(summary: dict[str, Any], is_json: bool, headline: str, has_queries: bool = True) -> None:
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
