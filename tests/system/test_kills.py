"""Kill -9 of the server, of a worker, of the scheduler, at random moments of a session: nothing is lost or doubled."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.settings import find_study
from app.store import open_store
from tests.support.screens import Screen, screens
from tests.support.server import ServerProcess, kill_process, running_server

pytestmark = pytest.mark.slow

N_KILLS = 20


@pytest.fixture
def study_file(tmp_path: Path) -> str:
    """A study long enough to be killed twenty times."""
    text = find_study("quickstart").text
    text = text.replace("active_queries = 8 ", "active_queries = 90 ").replace(
        "test_queries = 4 ", "test_queries = 10 "
    )
    assert "= 90 " in text
    assert "= 10 " in text
    path = tmp_path / "long.toml"
    path.write_text(text.replace('name = "quickstart"', 'name = "long"'))
    return str(path)


class Person(threading.Thread):
    """Answers like a browser: posts until the answer is acknowledged, however long the server is away."""

    def __init__(self, url: str, seed: int) -> None:
        super().__init__(daemon=True)
        self._client = httpx.Client(base_url=url, timeout=25.0)
        self._random = random.Random(seed)
        self.acknowledged: dict[int, str] = {}
        self.finished = threading.Event()
        self.failure: Exception | None = None
        joined = self._client.post("/join/long", content=b"")
        self._home = joined.headers["location"]

    def run(self) -> None:
        try:
            screen = self._insist(lambda: self._hear(after=-1))
            while screen["kind"] != "finished":
                screen = self._step(screen)
            self._client.close()
            self.finished.set()
        except Exception as error:  # noqa: BLE001 - shown by the test
            self.failure = error

    def _step(self, screen: Screen) -> Screen:
        if screen["kind"] == "preparing":
            return self._insist(lambda: self._hear(after=screen["position"]))
        index, choice = screen["query_index"], self._random.choice(("first", "second"))
        time.sleep(self._random.uniform(0.2, 1.0))
        body = {"query_index": index, "choice": choice, "response_time_ms": 700}
        receipt = self._insist(lambda: self._post(body))
        assert receipt["outcome"] in ("taken", "already-taken")
        self.acknowledged[index] = choice
        return dict(receipt["screen"])

    def _hear(self, after: int) -> Screen:
        return next(screen for screen in screens(self._client, self._home) if screen["position"] > after)

    def _post(self, body: dict[str, object]) -> dict[str, Any]:
        return dict(self._client.post(self._home + "answer", json=body).raise_for_status().json())

    def _insist(self, ask: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Repeats a request until it is answered; the same answer may so be posted twice."""
        deadline = time.monotonic() + 240
        while time.monotonic() < deadline:
            try:
                return ask()
            except httpx.TransportError:
                pass
            except httpx.HTTPStatusError as refused:
                if refused.response.status_code < 500:
                    raise
            time.sleep(0.1)
        raise AssertionError("the server did not come back")


def walk_while_killing(server: ServerProcess, seed: int, kill: object) -> Person:
    person = Person(server.url, seed)
    person.start()
    moments = random.Random(seed + 1)
    for _ in range(N_KILLS):
        time.sleep(moments.uniform(0.3, 2.0))
        assert not person.finished.is_set(), "the session must outlast the kills"
        kill()  # type: ignore[operator]
    person.finished.wait(400)
    assert person.failure is None, person.failure
    assert person.finished.is_set()
    return person


def next_process(server: ServerProcess, program: str) -> int:
    """Returns a living process of the engine; a killed one is replaced within seconds."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        found = server.children(program)
        if found:
            return found[0]
        time.sleep(0.05)
    raise AssertionError(f"no {program} came back")


def assert_nothing_lost_or_doubled(server: ServerProcess, person: Person) -> None:
    with open_store(server.database) as store:
        (record,) = store.sessions()
        answers = [e.payload for e in store.events(record.id) if e.kind == "answer_given"]
        asked = [e.payload for e in store.events(record.id) if e.kind == "query_prepared"]
    assert [answer["query_index"] for answer in answers] == list(range(100))
    assert [query["query_index"] for query in asked] == list(range(100))
    stored = {
        answer["query_index"]: "first" if answer["choice"] == query["first_shown"] else "second"
        for answer, query in zip(answers, asked, strict=True)
    }
    assert stored == person.acknowledged


def test_killing_the_server_loses_and_doubles_nothing(tmp_path: Path, study_file: str) -> None:
    with running_server(tmp_path, study_file) as server:

        def kill() -> None:
            server.kill()
            server.restart()

        person = walk_while_killing(server, 11, kill)
        assert_nothing_lost_or_doubled(server, person)


@pytest.mark.parametrize("program", ["dask_worker", "dask_scheduler"])
def test_killing_a_process_of_the_engine_loses_and_doubles_nothing(
    tmp_path: Path, study_file: str, program: str
) -> None:
    with running_server(tmp_path, study_file) as server:
        killed: set[int] = set()

        def kill() -> None:
            process_id = next_process(server, program)
            killed.add(process_id)
            kill_process(process_id)

        person = walk_while_killing(server, 12, kill)
        assert len(killed) == N_KILLS
        assert_nothing_lost_or_doubled(server, person)


def test_the_engine_does_not_outlive_a_killed_server(tmp_path: Path) -> None:
    with running_server(tmp_path) as server:
        engine = [*server.children("dask_scheduler"), *server.children("dask_worker")]
        assert len(engine) == 4  # a scheduler, two workers for queries, one that trains
        server.kill()
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline and any(Path(f"/proc/{pid}").exists() for pid in engine):
            time.sleep(0.1)
        assert not [pid for pid in engine if Path(f"/proc/{pid}").exists()]
