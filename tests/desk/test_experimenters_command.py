"""`prefstudy experimenter`: accounts from the terminal of whoever runs the server."""

from __future__ import annotations

from app.services.desk_accounts import COMMAND_LINE, DeskAccounts
from app.services.passwords import is_right
from app.store import Role, Store
from tests.support.command_line import assert_one_line_with, run


def test_a_printed_password_logs_in_and_a_reset_one_takes_its_place(store: Store, database_url: str) -> None:
    added = run("experimenter", "add", "anna", "--role", "viewer", "--database", database_url)
    first = added.stdout.strip().rpartition(": ")[2]
    assert is_right(first, store.desk.password_hash("anna"))
    assert [each.role for each in store.desk.experimenters()] == [Role.VIEWER]
    login = DeskAccounts(store).log_in("anna", first, "1.1.1.1")
    reset = run("experimenter", "reset", "anna", "--database", database_url)
    second = reset.stdout.strip().rpartition(": ")[2]
    assert second != first
    assert is_right(second, store.desk.password_hash("anna"))
    assert not is_right(first, store.desk.password_hash("anna"))
    assert DeskAccounts(store).experimenter(login) is None
    done = [(entry.who, entry.action) for entry in store.desk.audit()]
    assert done == [(COMMAND_LINE, "password_reset"), ("anna", "logged_in"), (COMMAND_LINE, "account_added")]


def test_a_name_that_nobody_has_is_refused_in_one_line(store: Store, database_url: str) -> None:
    refused = run("experimenter", "reset", "nobody", "--database", database_url)
    assert_one_line_with(refused, "got 'nobody'")
