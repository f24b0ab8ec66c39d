"""The commands that measure; each loads what it measures with only when it is called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.settings import find_study
from app.terminal import JsonOption, SeedOption, build_bank, new_progress, print_result

bench = typer.Typer(
    help="Measure this machine; every number is a ratio to the named alternative in the same run."
)


@bench.command("query")
def bench_query(seed: SeedOption = 0, json_: JsonOption = False) -> None:
    """Time from an answer to the next query, complete, against the same work done the plain way."""
    from app.bench import query

    with new_progress() as progress:
        print_result(query.run(seed, progress), json_)


@bench.command("posterior")
def bench_posterior(
    seed: SeedOption = 0,
    out: Annotated[
        Path | None, typer.Option(help="A new folder for the picture of the cost of an update.")
    ] = None,
    json_: JsonOption = False,
) -> None:
    """Effective draws per second beside other samplers; a belief update beside APReL's way."""
    from app.bench import posterior

    with new_progress() as progress:
        print_result(posterior.run(seed, progress, out), json_)


@bench.command("trajectories")
def bench_trajectories(seed: SeedOption = 0, json_: JsonOption = False) -> None:
    """Quality and time of the best drive from the bank, against ten and a thousand random starts."""
    from app.bench import trajectories

    with new_progress() as progress:
        print_result(trajectories.run(seed, progress), json_)


@bench.command("acquisition")
def bench_acquisition(
    people: Annotated[int, typer.Option(min=2, help="Simulated people, the same for every method.")] = 100,
    queries: Annotated[int, typer.Option(min=1, help="Active queries to each of them.")] = 30,
    seed: SeedOption = 0,
    json_: JsonOption = False,
    out: Annotated[
        Path | None, typer.Option(help="Draw the picture into this new folder, with its numbers.")
    ] = None,
) -> None:
    """Compare how fast the acquisition methods learn the same simulated people; ten to fifteen minutes on two cores."""
    from app.bench import acquisition

    build_bank(find_study(acquisition.STUDY))
    with new_progress() as progress:
        print_result(acquisition.run(seed, progress, people, queries, out), json_)


@bench.command("serve")
def bench_serve(
    people: Annotated[int, typer.Option(min=1, help="People at once.")] = 50,
    answers: Annotated[int, typer.Option(min=1, help="Answers in all.")] = 2000,
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Time from posting an answer to having the next query, many people at once, against a separate server process."""
    from app.bench import serve as serve_bench

    with new_progress() as progress:
        print_result(serve_bench.run(seed, people, answers, progress), json_)


@bench.command("export")
def bench_export(
    people: Annotated[int, typer.Option(min=4, help="People of 175 answers each.")] = 200,
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Rows a second and peak memory of exports in each format, against holding all rows and writing them plainly."""
    from app.bench import export

    with new_progress() as progress:
        print_result(export.run(seed, people, progress), json_)


@bench.command("monitor")
def bench_monitor(
    people: Annotated[int, typer.Option(min=1, help="People in the study.")] = 1000,
    loads: Annotated[int, typer.Option(min=1, help="How often each page is loaded.")] = 50,
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Time to load the desk's monitor of a study with many people, from a separate server process."""
    from app.bench import monitor

    with new_progress() as progress:
        print_result(monitor.run(seed, people, loads, progress), json_)


@bench.command("training")
def bench_training(seed: SeedOption = 0, json_: JsonOption = False) -> None:
    """Time to train the feature networks of a person and of a study, against the plain loop in torch."""
    from app.bench import training

    with new_progress() as progress:
        print_result(training.run(seed, progress), json_)


@bench.command("feature")
def bench_feature(
    people: Annotated[int, typer.Option(min=2, help="Simulated people of each taste.")] = 20,
    seed: SeedOption = 0,
    json_: JsonOption = False,
) -> None:
    """Accuracy with and without a feature learned in the middle of a session; some minutes on two cores."""
    from app.bench import feature

    build_bank(find_study(feature.STUDY))
    with new_progress() as progress:
        print_result(feature.run(seed, people, progress), json_)


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

    with new_progress() as progress:
        print_result(published.run(seed, data, progress), json_)
