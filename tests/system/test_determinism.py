"""The same session, computed by other processes, is the same to the last bit."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from app import wiring
from app.services.export import ExportOptions, export
from app.services.rehearsal import Rehearsal, rehearse_all
from app.services.rehearsed_person import Crowd
from app.settings import find_study
from app.store import open_store
from study_core.participants import Habits
from tests.support.exports import replayed
from tests.support.screens import screens
from tests.support.server import running_server

POSITIONS = ("first", "second", "second")


def test_a_session_served_by_the_engine_replays_headless_to_the_same_queries(tmp_path: Path) -> None:
    with running_server(tmp_path) as server, httpx.Client(base_url=server.url, timeout=30.0) as client:
        home = client.post("/join/quickstart", content=b"").headers["location"]
        for screen in screens(client, home):
            if screen["kind"] == "question":
                index = screen["query_index"]
                body = {"query_index": index, "choice": POSITIONS[index % 3], "response_time_ms": 800}
                client.post(home + "answer", json=body).raise_for_status()
        database = server.database
    with open_store(database) as store:
        export(store, tmp_path / "out", ExportOptions("jsonl", "real"))
    (person,) = replayed(tmp_path / "out")
    assert (person.way, person.n_queries, person.other_machines) == ("derived", 12, ())


@pytest.mark.slow
def test_simulated_people_are_the_same_in_this_process_and_on_the_engine() -> None:
    def rehearsed(n_workers: int) -> list[Rehearsal]:
        crowd = Crowd(12, 4, Habits(drift_rad=0.05, side_bias=0.2))
        with wiring.headless(n_workers=n_workers) as runtime:
            return list(rehearse_all(runtime, find_study("quickstart"), crowd, 2 * n_workers, lambda: None))

    assert rehearsed(n_workers=1) == rehearsed(n_workers=2)
