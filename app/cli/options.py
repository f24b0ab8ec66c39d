"""Options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

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
