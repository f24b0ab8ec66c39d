"""Who comes in to the desk, and how it ends."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta

import httpx
import pytest

from app.desk.admission import COOKIE, LIVE
from app.services.desk_accounts import DeskAccounts, TooManyTriesError, WrongCodeError, WrongPasswordError
from app.store import Role, Store
from tests.desk.conftest import Opener
from tests.desk.laboratory import PASSWORD, Laboratory


def log_in(visitor: httpx.Client, name: str, password: str = PASSWORD, **more: str) -> httpx.Response:
    return visitor.post("/desk/login", data={"name": name, "password": password, **more})


def age(lab: Laboratory, column: str, length: timedelta) -> None:
    """Lets every login be older."""
    at = (datetime.now(UTC) - length).strftime("%Y-%m-%d %H:%M:%S.%f")
    with closing(sqlite3.connect(lab.database)) as rows, rows:
        rows.execute(f"UPDATE desk_sessions SET {column} = ?", (at,))


def test_the_first_owner_needs_the_code_that_the_server_printed(empty: Laboratory) -> None:
    stranger = {"name": "mallory", "password": PASSWORD}
    with empty.nobody() as visitor:
        assert visitor.get("/desk/").headers["location"] == "/desk/setup"
        assert "Set-up code" in visitor.get("/desk/setup").text
        refused = visitor.post("/desk/setup", data=stranger | {"code": "0000-0000-0000"})
        assert refused.status_code == 403
        assert 'value="mallory"' in refused.text, "what was typed is still there"
        assert empty.store.desk.experimenters() == []
        code = empty.accounts.setup_code
        assert code is not None
        made = visitor.post(
            "/desk/setup", data={"name": "olga", "password": PASSWORD, "code": code.lower().replace("-", " ")}
        )
        assert made.headers["location"] == "/desk/"
        assert "Studies" in visitor.get("/desk/").text
        again = visitor.post("/desk/setup", data=stranger | {"code": code})
        assert again.headers["location"] == "/desk/login"
    (owner,) = empty.store.desk.experimenters()
    assert (owner.name, owner.role) == ("olga", Role.OWNER)


def test_a_server_that_has_an_owner_prints_no_code(lab: Laboratory) -> None:
    assert DeskAccounts(lab.store).setup_code is None


def test_a_short_password_is_refused_with_its_length(empty: Laboratory) -> None:
    with empty.nobody() as visitor:
        code = empty.accounts.setup_code or ""
        refused = visitor.post("/desk/setup", data={"name": "olga", "password": "short", "code": code})
    assert refused.status_code == 422
    assert "got 5" in refused.text
    assert code in refused.text


def test_logging_in_leads_back_to_where_one_was(lab: Laboratory) -> None:
    with lab.nobody() as visitor:
        sent_away = visitor.get("/desk/studies/quickstart?show=signs")
        assert sent_away.status_code == 303
        page = visitor.get(sent_away.headers["location"])
        assert "has ended" not in page.text
        assert 'name="next" value="/desk/studies/quickstart?show=signs"' in page.text
        came_back = log_in(visitor, "vera", next="/desk/studies/quickstart?show=signs")
        assert came_back.headers["location"] == "/desk/studies/quickstart?show=signs"
        assert visitor.get(came_back.headers["location"]).status_code == 200


@pytest.mark.parametrize(
    "place",
    [
        "https://evil.example/desk/",
        "//evil.example",
        "/desk//evil.example",
        "/join/quickstart",
        "/desk/\\evil",
    ],
)
def test_logging_in_leads_nowhere_else(lab: Laboratory, place: str) -> None:
    with lab.nobody() as visitor:
        assert log_in(visitor, "vera", next=place).headers["location"] == "/desk/"


def test_the_login_is_out_of_reach_of_scripts_other_sites_and_other_pages(lab: Laboratory) -> None:
    with lab.nobody() as visitor:
        cookies = log_in(visitor, "vera").headers.get_list("set-cookie")
    assert {part for cookie in cookies for part in cookie.split("; ") if part.startswith("Path")} == {
        "Path=/desk",
        "Path=/api",
    }
    for cookie in cookies:
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie


def test_logging_out_ends_the_login_everywhere_it_is_kept(lab: Laboratory) -> None:
    with lab.browser(Role.VIEWER) as visitor:
        kept = next(iter(visitor.cookies.jar)).value or ""
        assert visitor.get("/desk/").status_code == 200
        assert visitor.post("/desk/logout").headers["location"] == "/desk/login"
        assert visitor.get("/desk/", headers={"Cookie": f"{COOKIE}={kept}"}).status_code == 303


@pytest.mark.parametrize(
    ("column", "length"), [("last_seen_at", timedelta(hours=12.1)), ("created_at", timedelta(days=7.1))]
)
def test_a_login_ends_when_it_is_idle_or_old_and_says_so(
    opened: Opener, column: str, length: timedelta
) -> None:
    with opened() as lab, lab.browser(Role.OWNER) as visitor:
        age(lab, column, length * 0.9)
        assert visitor.get("/desk/").status_code == 200
        age(lab, column, length)
        sent_away = visitor.get("/desk/accounts")
        assert sent_away.status_code == 303
        assert "Your login has ended" in visitor.get(sent_away.headers["location"]).text
        assert visitor.get("/desk/", headers={LIVE: "1"}).status_code == 401


def test_a_page_that_keeps_itself_up_to_date_keeps_nobody_logged_in(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.OWNER) as visitor:
        age(lab, "last_seen_at", timedelta(hours=11))
        assert visitor.get("/desk/", headers={LIVE: "1"}).status_code == 200
        age(lab, "created_at", timedelta(hours=11))
        with closing(sqlite3.connect(lab.database)) as rows:
            (before,) = rows.execute("SELECT last_seen_at FROM desk_sessions").fetchone()
            assert visitor.get("/desk/").status_code == 200
            (after,) = rows.execute("SELECT last_seen_at FROM desk_sessions").fetchone()
    assert before < after, "only what somebody has done counts"


def test_a_form_that_comes_after_the_login_has_ended_loses_nothing(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.ASSISTANT) as visitor:
        session_id = lab.under_way()
        age(lab, "last_seen_at", timedelta(hours=13))
        typed = {"verdict": "excluded", "reason": "slept", "note": "a <long>\n note", "revision": "0"}
        interrupted = visitor.post(f"/desk/people/{session_id}/review", data=typed)
        assert interrupted.status_code == 401
        assert "Nothing of what you typed is lost" in interrupted.text
        assert "a &lt;long&gt;\n note" in interrupted.text
        carried = {f"kept.{name}": value for name, value in typed.items()}
        path = {"kept-path": f"/desk/people/{session_id}/review"}
        wrong = log_in(visitor, "adam", "not the password", **carried, **path)
        assert "a &lt;long&gt;\n note" in wrong.text, "a wrong password loses nothing either"
        page = log_in(visitor, "adam", **carried, **path)
        assert page.status_code == 200
        assert f'action="/desk/people/{session_id}/review"' in page.text
        assert "a &lt;long&gt;\n note" in page.text
        assert lab.store.desk.review(session_id).revision == 0, "nothing is done before they say so"
        assert visitor.post(f"/desk/people/{session_id}/review", data=typed).status_code == 303
        assert lab.store.desk.review(session_id).note == "a <long>\n note"


def test_a_password_that_was_typed_into_an_interrupted_form_is_not_carried_along(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.OWNER) as visitor:
        age(lab, "last_seen_at", timedelta(hours=13))
        page = visitor.post(
            "/desk/me", data={"old-password": "the old secret one", "new-password": "the new secret one"}
        )
    assert page.status_code == 401
    assert "secret one" not in page.text


def test_a_changed_password_logs_out_everybody_who_had_the_old_one(opened: Opener) -> None:
    with opened() as lab, lab.browser(Role.VIEWER) as elsewhere, lab.browser(Role.VIEWER) as here:
        changed = here.post("/desk/me", data={"old-password": PASSWORD, "new-password": "another long one"})
        assert "is changed" in changed.text
        assert elsewhere.get("/desk/").status_code == 303
        assert here.get("/desk/").status_code == 200
        assert log_in(elsewhere, "vera").status_code == 403
        assert log_in(elsewhere, "vera", "another long one").status_code == 303


def test_a_write_that_does_not_say_which_page_asks_for_it_is_refused(lab: Laboratory, person: str) -> None:
    with lab.browser(Role.ASSISTANT) as visitor:
        del visitor.headers["Origin"]
        assert visitor.post(f"/desk/people/{person}/reopen").status_code == 403
        assert visitor.put(f"/api/v1/people/{person}/review", json={"revision": 0}).status_code == 403
        visitor.headers["Origin"] = "https://evil.example"
        assert visitor.post(f"/desk/people/{person}/reopen").status_code == 403


# ---- slowed down ----


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """The time by which wrong tries are slowed down, to be put forward."""
    clock = Clock()
    monkeypatch.setattr("app.services.slowdown.monotonic", clock)
    return clock


@pytest.fixture
def accounts(store: Store, clock: Clock) -> DeskAccounts:
    made = DeskAccounts(store)
    made.add("tests", "anna", PASSWORD, Role.OWNER)
    return made


def tries_until_refused(accounts: DeskAccounts, name: str, address: str) -> int:
    for n in range(1, 50):
        try:
            accounts.log_in(name, "wrong password", address)
        except WrongPasswordError:
            continue
        except TooManyTriesError:
            return n
    raise AssertionError("nobody was slowed down")


def test_wrong_passwords_wait_twice_as_long_each_time_and_never_for_ever(
    accounts: DeskAccounts, clock: Clock
) -> None:
    for _ in range(3):
        with pytest.raises(WrongPasswordError):
            accounts.log_in("anna", "wrong password", "1.1.1.1")
    waits = []
    for number in range(8):
        # From another address each time: it is the name that waits.
        with pytest.raises(TooManyTriesError) as refused:
            accounts.log_in("anna", PASSWORD, f"1.1.2.{number}")
        waits.append(refused.value.wait_s)
        clock.now += waits[-1]
        with pytest.raises(WrongPasswordError):
            accounts.log_in("anna", "wrong password", f"1.1.2.{number}")
    assert waits == [1, 2, 4, 8, 16, 30, 30, 30]
    clock.now += 30
    accounts.log_in("anna", PASSWORD, "1.1.1.1")
    assert tries_until_refused(accounts, "anna", "9.9.9.9") == 4, "a right one begins anew"


def test_an_address_that_tries_many_names_is_slowed_down_too(accounts: DeskAccounts, clock: Clock) -> None:
    for number in range(10):
        with pytest.raises(WrongPasswordError):
            accounts.log_in(f"name{number}", "wrong password", "1.1.1.1")
    with pytest.raises(TooManyTriesError):
        accounts.log_in("anna", PASSWORD, "1.1.1.1")
    accounts.log_in("anna", PASSWORD, "2.2.2.2")
    clock.now += 3600
    accounts.log_in("anna", PASSWORD, "1.1.1.1")


def test_an_unknown_name_is_told_what_a_known_one_is(accounts: DeskAccounts) -> None:
    said = []
    for name in ("anna", "nobody"):
        with pytest.raises(WrongPasswordError) as refused:
            accounts.log_in(name, "wrong password", "1.1.1.1")
        said.append(str(refused.value))
    assert said[0] == said[1]
    assert tries_until_refused(accounts, "nobody", "3.3.3.3") == 3


def test_the_set_up_code_can_not_be_guessed_quickly(store: Store, clock: Clock) -> None:
    accounts = DeskAccounts(store)
    for _ in range(3):
        with pytest.raises(WrongCodeError):
            accounts.set_up("0000-0000-0000", "mallory", PASSWORD, "1.1.1.1")
    with pytest.raises(TooManyTriesError):
        accounts.set_up("0000-0000-0000", "mallory", PASSWORD, "2.2.2.2")
