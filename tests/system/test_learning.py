"""Whoever finishes a served study is learned from, by a process of the engine, even if that one is killed."""

from __future__ import annotations

import time
from pathlib import Path

import httpx
import numpy as np

from app.services.people import person
from app.settings import find_study
from app.store import Store, open_store
from app.training import PERSONAL_NETWORK
from study_core.networks.checkpoint import from_bytes
from study_core.predictors.personal_network import PersonalNetwork, model_of
from tests.support.screens import screens
from tests.support.server import ServerProcess, kill_process, running_server

_PATIENCE_S = 120.0
_N_ACTIVE = 11


def study_in(folder: Path) -> str:
    text = find_study("quickstart").text.replace("active_queries = 8 ", f"active_queries = {_N_ACTIVE} ")
    path = folder / "mine.toml"
    path.write_text(text.replace("test_queries = 4 ", "test_queries = 1 "))
    return str(path)


def answer_everything(server: ServerProcess) -> None:
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        home = client.post("/join/quickstart", content=b"").headers["location"]
        for index in range(_N_ACTIVE + 1):
            next(screen for screen in screens(client, home) if screen["query_index"] == index)
            body = {"query_index": index, "choice": "ab"[index % 2], "response_time_ms": 900}
            client.post(f"{home}answer", json=body).raise_for_status()


def arrived(store: Store, session_id: str) -> bytes:
    until = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until:
        model = store.personal_model(session_id, PERSONAL_NETWORK.kind)
        if model is not None:
            return model.content
        time.sleep(0.1)
    raise AssertionError("no model came")


def test_whoever_finishes_is_learned_from_though_workers_die(tmp_path: Path) -> None:
    with running_server(tmp_path, study_in(tmp_path)) as server:
        answer_everything(server)
        for worker in server.children("dask_worker"):
            kill_process(worker)
        with open_store(server.database) as store:
            (record,) = store.sessions()
            known = person(store, record)
            model = model_of(from_bytes(arrived(store, record.id)))
    name = str(known.participant)
    expected = (
        PersonalNetwork().fit(known.study.seed, known.study.domain, {name: known.training}).people[name]
    )
    assert len(known.training) == _N_ACTIVE
    np.testing.assert_array_equal(
        model.probability_of_a(known.training.pairs), expected.probability_of_a(known.training.pairs)
    )
