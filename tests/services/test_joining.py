"""Who comes in to a study and who comes back: nobody twice, nobody as somebody else."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app import wiring
from app.services import leaving, path
from app.services import study as services
from app.services.joining import (
    Arrival,
    Door,
    Visit,
    Welcome,
    can_begin_again,
    code_of,
    end_if_too_old,
)
from app.services.links import Invitation
from app.services.runtime import Runtime
from app.services.tokens import hash_code, hash_token, is_token, new_token, next_token, resume_code
from app.settings import find_study
from app.store import ExternalPerson, SessionDeletedError, Source
from study_core.path import Ending
from study_core.study import Study, parse_study

# A page first, so that joining computes no query.
STEPS = '\n[[path]]\nstep = "text"\ntext = "welcome"\n[[path]]\nstep = "queries"\n'
ALICE = Invitation(ExternalPerson("quickstart", "alice", {"STUDY_ID": "a-study"}), is_signed=False)
ALICES_OWN = Invitation(ALICE.person, is_signed=True)
ANYBODY = Invitation(None, is_signed=False)


def study_with(sections: str = "") -> Study:
    return parse_study(find_study("quickstart").text + STEPS + sections)


@pytest.fixture
def runtime(database_url: str) -> Iterator[Runtime]:
    with wiring.headless(database_url) as opened:
        yield opened


@pytest.fixture
def door(runtime: Runtime) -> Door:
    return Door(runtime, study_with())


def new(invitation: Invitation = ANYBODY, token: str | None = None) -> Visit:
    return Visit(invitation, token)


def join(door: Door, invitation: Invitation = ANYBODY) -> str:
    """Lets somebody in, and returns their token."""
    token = door.join(new(invitation), new_token()).token
    assert token is not None
    return token


def session_of(runtime: Runtime, token: str) -> str:
    found = services.find(runtime, token)
    assert found is not None
    return found.id


def grow_old(database_url: str, session_id: str, hours: float) -> None:
    """Lets a session have begun so many hours ago, and nothing have been heard of it since."""
    begun = (datetime.now(UTC) - timedelta(hours=hours)).strftime("%Y-%m-%d %H:%M:%S.%f")
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as rows, rows:
        rows.execute("UPDATE sessions SET created_at = ? WHERE id = ?", (begun, session_id))
        rows.execute("UPDATE standings SET last_at = ? WHERE session_id = ?", (begun, session_id))


def all_at_once(*actions: Callable[[], Welcome]) -> list[Welcome]:
    start, found = threading.Barrier(len(actions)), []

    def act(action: Callable[[], Welcome]) -> None:
        start.wait(timeout=30)
        found.append(action())

    threads = [threading.Thread(target=act, args=(action,)) for action in actions]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert len(found) == len(actions)
    return found


def test_a_code_is_short_unambiguous_and_read_as_people_write_it() -> None:
    token = new_token()
    code = resume_code(token)
    assert is_token(token)
    assert is_token(next_token(token))
    assert next_token(token) == next_token(token) != token
    assert [len(group) for group in code.split("-")] == [4, 4, 4]
    assert not set(code) & set("ILOU")
    assert resume_code(token) == code != resume_code(new_token())
    typed = code.lower().replace("-", " ").replace("1", "l").replace("0", "o")
    assert hash_code(f" {typed} ") == hash_code(code)
    codes = {resume_code(new_token()) for _ in range(2000)}
    assert len(codes) == 2000
    assert len({character for each in codes for character in each}) == 33


def test_looking_at_a_link_makes_nothing(runtime: Runtime, door: Door) -> None:
    for invitation in (ANYBODY, ALICE, ALICES_OWN):
        assert door.arrive(new(invitation, new_token())).arrival is Arrival.NEW
    assert runtime.store.sessions() == []


def test_the_same_page_sent_twice_makes_one_session(runtime: Runtime, door: Door) -> None:
    for invitation in (ANYBODY, ALICE):
        ticket = new_token()
        first = door.join(new(invitation), ticket)
        assert first == door.join(new(invitation), ticket) == Welcome(Arrival.RESUMED, ticket)
    assert len(runtime.store.sessions()) == 2


def test_a_page_sent_again_after_a_kill_between_joining_and_beginning_goes_on(
    runtime: Runtime, door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticket = new_token()
    with monkeypatch.context() as patched:
        patched.setattr(services, "begin", killed)
        with pytest.raises(KeyboardInterrupt):
            door.join(new(ALICE), ticket)
    (session,) = runtime.store.sessions()
    assert runtime.store.events(session.id) == ()
    # Whoever reloads the link finds the session, and may begin it there, or by sending the page again.
    assert door.arrive(new(ALICE, ticket)) == Welcome(Arrival.RESUMED, ticket)
    assert services.screen(runtime, session.id).kind == "welcome"
    assert door.join(new(ALICE), ticket).token == ticket
    assert [event.kind for event in runtime.store.events(session.id)] == ["session_begun"]
    assert len(runtime.store.sessions()) == 1


def killed(*_: object) -> None:
    raise KeyboardInterrupt


def test_of_many_browsers_at_once_with_one_id_one_makes_a_session(runtime: Runtime, door: Door) -> None:
    found = all_at_once(*[lambda: door.join(new(ALICE), new_token())] * 8)
    assert sorted(welcome.arrival for welcome in found) == [Arrival.KNOWN_ELSEWHERE] * 7 + [Arrival.RESUMED]
    assert [welcome.token for welcome in found if welcome.arrival is Arrival.KNOWN_ELSEWHERE] == [None] * 7
    assert len(runtime.store.sessions()) == 1


def test_a_double_click_at_the_very_same_moment_makes_one_session(runtime: Runtime, door: Door) -> None:
    for invitation in (ANYBODY, ALICE):
        ticket = new_token()
        twice = all_at_once(*[lambda who=invitation, one=ticket: door.join(new(who), one)] * 2)
        assert [welcome.token for welcome in twice] == [ticket, ticket]
    assert len(runtime.store.sessions()) == 2


def test_the_browser_used_before_comes_back_at_once(runtime: Runtime, door: Door) -> None:
    token = join(door, ALICE)
    assert door.arrive(new(ALICE, token)) == Welcome(Arrival.RESUMED, token)
    assert door.join(new(ALICE, token), new_token()) == Welcome(Arrival.RESUMED, token)
    assert len(runtime.store.sessions()) == 1


def test_an_id_alone_opens_nothing(runtime: Runtime, door: Door) -> None:
    join(door, ALICE)
    for token in (None, new_token(), "nonsense"):
        assert door.arrive(new(ALICE, token)) == Welcome(Arrival.KNOWN_ELSEWHERE)
        assert door.join(new(ALICE, token), new_token()) == Welcome(Arrival.KNOWN_ELSEWHERE)
    assert len(runtime.store.sessions()) == 1


def test_another_persons_browser_opens_nothing_either(runtime: Runtime, door: Door) -> None:
    bobs = join(door, Invitation(ExternalPerson("quickstart", "bob"), is_signed=False))
    anybodys = join(door)
    join(door, ALICE)
    for token in (bobs, anybodys):
        assert door.arrive(new(ALICE, token)) == Welcome(Arrival.KNOWN_ELSEWHERE)
        # Their ticket names their session, which isn't Alice's.
        assert door.join(new(ALICE), token) == Welcome(Arrival.KNOWN_ELSEWHERE)


def test_a_ticket_that_opens_somebody_elses_session_is_not_used_again(runtime: Runtime, door: Door) -> None:
    used = join(door)
    token = door.join(new(ALICE), used).token
    assert token not in (None, used)
    assert len(runtime.store.sessions()) == 2


def test_a_signed_link_opens_the_session_in_any_browser(runtime: Runtime, door: Door) -> None:
    first = join(door, ALICES_OWN)
    assert door.arrive(new(ALICES_OWN)) == Welcome(Arrival.INVITED_BACK)
    second = join(door, ALICES_OWN)
    assert second != first
    assert session_of(runtime, second) == session_of(runtime, first)
    assert len(runtime.store.sessions()) == 1


def test_the_right_code_gets_a_token_and_a_wrong_one_nothing(runtime: Runtime, door: Door) -> None:
    first = join(door, ALICE)
    code = code_of(runtime, first)
    assert code is not None
    token = new_token()
    assert door.resume(code.lower(), token) == token
    assert session_of(runtime, token) == session_of(runtime, first)
    # The new token has a code of its own.
    assert code_of(runtime, token) not in (None, code)
    assert door.resume("0000-0000-0000", new_token()) is None
    assert door.resume("", new_token()) is None
    assert code_of(runtime, new_token()) is None


def test_a_code_of_another_study_opens_nothing(runtime: Runtime, door: Door) -> None:
    other = parse_study(study_with().text.replace('name = "quickstart"', 'name = "another"'))
    code = resume_code(join(Door(runtime, other)))
    assert door.resume(code, new_token()) is None


def test_neither_token_nor_code_stands_in_the_database(
    runtime: Runtime, door: Door, database_url: str
) -> None:
    token = join(door, ALICE)
    file = Path(database_url.removeprefix("sqlite:///"))
    content = file.read_bytes() + file.with_name(f"{file.name}-wal").read_bytes()
    assert hash_token(token).encode() in content
    for secret in (token, resume_code(token), resume_code(token).replace("-", "")):
        assert secret.encode() not in content


def test_with_the_same_link_for_everybody_the_next_person_at_a_browser_is_somebody_new(
    runtime: Runtime, door: Door
) -> None:
    token = join(door)
    assert door.arrive(new(ANYBODY, token)).arrival is Arrival.RESUMED
    path.end(runtime, session_of(runtime, token), Ending.STOPPED)
    assert door.arrive(new(ANYBODY, token)) == Welcome(Arrival.NEW, token)
    assert door.join(new(ANYBODY, token), new_token()).token not in (None, token)


def test_an_id_that_has_finished_never_begins_again(runtime: Runtime, door: Door) -> None:
    token = join(door, ALICE)
    path.end(runtime, session_of(runtime, token), Ending.STOPPED)
    assert door.arrive(new(ALICE, token)) == Welcome(Arrival.RESUMED, token)
    assert door.arrive(new(ALICE)).arrival is Arrival.KNOWN_ELSEWHERE
    assert door.arrive(new(ALICES_OWN)).arrival is Arrival.INVITED_BACK
    assert len(runtime.store.sessions()) == 1


def test_whoever_stopped_before_a_question_finds_the_end_after_a_restart(runtime: Runtime) -> None:
    asking = Door(runtime, find_study("quickstart"))
    session_id = session_of(runtime, join(asking))
    assert services.screen(runtime, session_id).kind == "question"
    path.end(runtime, session_id, Ending.STOPPED)
    for _ in range(2):
        assert services.screen(runtime, session_id).kind == "finished"
        runtime.forget(session_id)


def test_an_id_is_one_person_across_versions_of_the_study(runtime: Runtime, door: Door) -> None:
    token = join(door, ALICE)
    mended = parse_study(study_with().text.replace('title = "', 'title = "Mended: '))
    assert Door(runtime, mended).arrive(new(ALICE, token)).arrival is Arrival.RESUMED
    assert Door(runtime, mended).arrive(new(ALICE)).arrival is Arrival.KNOWN_ELSEWHERE


HOUR = timedelta(hours=1)


@pytest.mark.parametrize(
    ("opens", "closes", "expected"),
    [(HOUR, None, Arrival.NOT_YET), (-HOUR, HOUR, Arrival.NEW), (None, -HOUR, Arrival.CLOSED)],
)
def test_a_study_lets_people_in_between_opening_and_closing(
    runtime: Runtime, opens: timedelta | None, closes: timedelta | None, expected: Arrival
) -> None:
    now = datetime.now(UTC).replace(microsecond=0)
    lines = [f"{k} = {(now + v).isoformat()}" for k, v in (("opens", opens), ("closes", closes)) if v]
    door = Door(runtime, study_with("[recruitment]\n" + "\n".join(lines)))
    assert door.arrive(new(ALICE)).arrival is expected
    assert (door.join(new(ALICE), new_token()).token is None) == (expected is not Arrival.NEW)
    assert len(runtime.store.sessions()) == (expected is Arrival.NEW)


def test_closing_sends_nobody_away_who_is_in(runtime: Runtime, door: Door) -> None:
    token = join(door, ALICE)
    begun = datetime.now(UTC).replace(microsecond=0) - HOUR
    closed = Door(runtime, study_with(f"[recruitment]\ncloses = {begun.isoformat()}"))
    assert closed.arrive(new(ALICE, token)).arrival is Arrival.RESUMED
    assert closed.arrive(new(ALICE)).arrival is Arrival.KNOWN_ELSEWHERE
    assert closed.arrive(new(ALICES_OWN)).arrival is Arrival.INVITED_BACK
    assert closed.arrive(new()).arrival is Arrival.CLOSED


@pytest.mark.parametrize("invitation", [ANYBODY, ALICE])
def test_whoever_was_deleted_by_another_process_is_somebody_new(
    runtime: Runtime, door: Door, invitation: Invitation
) -> None:
    token = join(door, invitation)
    session_id = session_of(runtime, token)
    runtime.store.delete_session(session_id)
    # What this process knew of the session has made room for others'; that it knows the token hasn't.
    del runtime._live[session_id]
    assert door.arrive(new(invitation, token)) == Welcome(Arrival.NEW)
    assert door.join(new(invitation, token), new_token()).arrival is Arrival.RESUMED
    assert len(runtime.store.sessions()) == 1


def test_a_full_study_lets_somebody_in_for_each_who_leaves(
    runtime: Runtime, database_url: str, door: Door
) -> None:
    limited = Door(runtime, study_with("[recruitment]\nplaces = 2"))
    first, _ = join(limited), join(limited)
    assert limited.arrive(new()).arrival is Arrival.FULL
    assert limited.join(new(), new_token()) == Welcome(Arrival.FULL)
    path.end(runtime, session_of(runtime, first), Ending.STOPPED)
    third = join(limited)
    assert limited.arrive(new()).arrival is Arrival.FULL
    leaving.delete(runtime, session_of(runtime, third))
    fourth = join(limited)
    assert limited.arrive(new()).arrival is Arrival.FULL
    # Nobody holds a place for longer than a day without going on.
    grow_old(database_url, session_of(runtime, fourth), 25)
    assert limited.arrive(new()).arrival is Arrival.NEW
    assert limited.arrive(new(ANYBODY, fourth)).arrival is Arrival.RESUMED


def test_the_last_place_is_given_once(runtime: Runtime) -> None:
    limited = Door(runtime, study_with("[recruitment]\nplaces = 3"))
    found = all_at_once(*[lambda: limited.join(new(), new_token())] * 8)
    assert sorted(welcome.arrival for welcome in found) == [Arrival.FULL] * 5 + [Arrival.RESUMED] * 3
    assert len(runtime.store.sessions()) == 3


def test_rehearsals_take_no_place(runtime: Runtime) -> None:
    study = study_with("[recruitment]\nplaces = 1")
    runtime.store.put_study(study.hash, study.name, study.text)
    runtime.store.create_session(study.hash, hash_token(new_token()), Source.REHEARSED)
    assert Door(runtime, study).arrive(new()).arrival is Arrival.NEW


@pytest.fixture
def aged(runtime: Runtime, database_url: str, request: pytest.FixtureRequest) -> tuple[Door, str, str]:
    """A study with a maximum age of two hours, and somebody who began three hours ago."""
    door = Door(runtime, study_with(f'[session]\nmax_age_hours = 2\nwhen_old = "{request.param}"'))
    token = join(door, ALICE)
    session_id = session_of(runtime, token)
    end_if_too_old(runtime, session_id)
    assert runtime.live(session_id).state.ending is None
    grow_old(database_url, session_id, 3)
    runtime.forget(session_id)
    end_if_too_old(runtime, session_id)
    return door, token, session_id


@pytest.mark.parametrize("aged", ["end", "restart"], indirect=True)
def test_whoever_comes_back_too_late_has_timed_out(runtime: Runtime, aged: tuple[Door, str, str]) -> None:
    door, token, session_id = aged
    live = runtime.live(session_id)
    assert live.state.ending is Ending.TIMED_OUT
    assert runtime.store.ending(session_id) == "timed-out"
    assert can_begin_again(live) == (live.study.file.session.when_old == "restart")
    assert door.arrive(new(ALICE, token)) == Welcome(Arrival.RESUMED, token)


@pytest.mark.parametrize("aged", ["end"], indirect=True)
def test_where_the_study_says_so_that_is_the_end(runtime: Runtime, aged: tuple[Door, str, str]) -> None:
    door, token, _ = aged
    assert door.begin_again(token) == Welcome(Arrival.RESUMED, token)
    assert len(runtime.store.sessions()) == 1


@pytest.mark.parametrize("aged", ["restart"], indirect=True)
def test_where_the_study_says_so_they_begin_again_once(runtime: Runtime, aged: tuple[Door, str, str]) -> None:
    door, token, session_id = aged
    found = all_at_once(*[lambda: door.begin_again(token)] * 4)
    assert found == [Welcome(Arrival.RESUMED, next_token(token))] * 4
    new_id = session_of(runtime, next_token(token))
    assert new_id != session_id
    assert len(runtime.store.sessions()) == 2
    # The id now leads to the new session, and so does what the old one's browser has kept.
    found_now = runtime.store.session_of_person("quickstart", "alice")
    assert found_now is not None
    assert found_now.id == new_id
    assert door.arrive(new(ALICE)).arrival is Arrival.KNOWN_ELSEWHERE


@pytest.mark.parametrize("aged", ["restart"], indirect=True)
def test_two_browsers_of_an_old_session_begin_again_in_one_new_session(
    runtime: Runtime, aged: tuple[Door, str, str]
) -> None:
    door, token, session_id = aged
    runtime.store.add_token(session_id, hash_token("another browser's tok"), None)
    begun = door.begin_again(token).token
    joined = door.begin_again("another browser's tok").token
    assert begun is not None
    assert joined is not None
    assert session_of(runtime, joined) == session_of(runtime, begun)
    assert len(runtime.store.sessions()) == 2


@pytest.mark.parametrize("aged", ["restart"], indirect=True)
def test_deleting_the_new_session_takes_the_old_one_along(
    runtime: Runtime, aged: tuple[Door, str, str]
) -> None:
    door, token, session_id = aged
    begun = door.begin_again(token).token
    assert begun is not None
    leaving.delete(runtime, session_of(runtime, begun))
    assert runtime.store.sessions() == []
    assert [services.find(runtime, each) for each in (token, begun)] == [None, None]
    with pytest.raises(SessionDeletedError):
        runtime.live(session_id)


def test_a_session_that_has_not_begun_is_never_begun_again(runtime: Runtime, door: Door) -> None:
    token = join(door)
    assert door.begin_again(token) == Welcome(Arrival.RESUMED, token)
    assert len(runtime.store.sessions()) == 1
