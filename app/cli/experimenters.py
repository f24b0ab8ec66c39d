"""Commands for accounts of the desk: for whoever runs the server, also when a password was forgotten."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from app.cli.options import DatabaseOption
from app.settings import DEFAULT_DATABASE

experimenter = typer.Typer(help="Accounts of the experimenters’ desk.")

Name = Annotated[str, typer.Argument(help="What they log in with.")]
Ask = Annotated[bool, typer.Option("--ask", help="Ask for the password here, instead of making one up.")]


@experimenter.command()
def add(
    name: Name,
    role: Annotated[
        Literal["owner", "assistant", "viewer"], typer.Option(help="What they may do.")
    ] = "assistant",
    ask: Ask = False,
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Let somebody use the desk; prints their password, this once."""
    from app.services.desk_accounts import COMMAND_LINE, DeskAccounts
    from app.services.passwords import new_password
    from app.store import Role, open_store

    password = _asked() if ask else new_password()
    with open_store(database) as store:
        DeskAccounts(store).add(COMMAND_LINE, name, password, Role(role))
    _tell(name, None if ask else password)


@experimenter.command()
def reset(name: Name, ask: Ask = False, database: DatabaseOption = DEFAULT_DATABASE) -> None:
    """Give somebody another password, and log them out everywhere; prints it, this once."""
    from app.services.desk_accounts import COMMAND_LINE, DeskAccounts
    from app.store import open_existing_store

    asked = _asked() if ask else None
    with open_existing_store(database) as store:
        password = DeskAccounts(store).reset_password(COMMAND_LINE, name, asked)
    _tell(name, None if ask else password)


def _asked() -> str:
    password: str = typer.prompt("Password", hide_input=True, confirmation_prompt=True)
    return password


def _tell(name: str, password: str | None) -> None:
    print(f"{name} can log in." if password is None else f"{name} can log in with the password: {password}")
