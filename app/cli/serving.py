"""Commands that let people in: `serve` and `link`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from app import log
from app.cli.options import DatabaseOption, SchedulerOption, StudyOption
from app.settings import DEFAULT_DATABASE, DEFAULT_STUDY, find_study
from app.terminal import build_bank, console

if TYPE_CHECKING:
    from app.wiring import Addresses


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
    wiring.serve(settings, _announce)


def _announce(addresses: Addresses) -> None:
    print(f"Participants open: {addresses.join}")
    print(f"Experimenters open: {addresses.desk}", flush=True)
    if addresses.n_before:
        console.print(
            f"[yellow]Note:[/] {addresses.n_before} people have begun another version of this study, and go on with it."
            " Whoever begins now meets this one; every record says which.",
            highlight=False,
        )
    if addresses.setup_code is not None:
        print(f"Nobody has the desk yet. Its first owner needs this code: {addresses.setup_code}", flush=True)


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
