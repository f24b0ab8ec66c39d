"""Served people are learned from by a process of the engine, after their session and in the middle of it."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import httpx
import numpy as np
import pytest

from app.services.people import person
from app.services.population import KIND as POPULATION
from app.settings import find_study
from app.store import Store, open_store
from app.training import PERSONAL_NETWORK
from study_core import session_codec
from study_core.comparison import ComparisonSet
from study_core.events import FeatureLearned, PopulationAdopted
from study_core.knowledge import Knowledge
from study_core.learning import compared
from study_core.networks.checkpoint import from_bytes
from study_core.online.learn import learn_feature
from study_core.predictors.hand_coded_population import learn_population_prior
from study_core.predictors.linear_people import ComparedFeatures
from study_core.predictors.personal_network import PersonalNetwork, model_of
from study_core.queries import infer_posterior
from study_core.session import reduce
from study_core.study import parse_study
from tests.support.screens import screens
from tests.support.server import ServerProcess, kill_process, running_server

_PATIENCE_S = 120.0
_N_ACTIVE = 11


def study_in(folder: Path) -> str:
    text = find_study("quickstart").text.replace("active_queries = 8 ", f"active_queries = {_N_ACTIVE} ")
    path = folder / "mine.toml"
    path.write_text(text.replace("test_queries = 4 ", "test_queries = 1 "))
    return str(path)


def online_study_in(folder: Path) -> str:
    text = find_study("online").text
    for old, new in (
        ("active_queries = 60 ", "active_queries = 24 "),
        ("test_queries = 40 ", "test_queries = 1 "),
        ("feature_every = 20 ", "feature_every = 15 "),
    ):
        text = text.replace(old, new)
    path = folder / "online.toml"
    path.write_text(text)
    return str(path)


def answer_everything(server: ServerProcess, name: str, n_queries: int) -> None:
    """Answers as somebody who cares for the first feature alone."""
    with httpx.Client(base_url=server.url, timeout=60.0) as client, open_store(server.database) as store:
        home = client.post(f"/join/{name}", content=b"").headers["location"]
        for index in range(n_queries):
            next(screen for screen in screens(client, home) if screen["query_index"] == index)
            body = {"query_index": index, "choice": liked(store, index), "response_time_ms": 900}
            client.post(f"{home}answer", json=body).raise_for_status()


def liked(store: Store, query_index: int) -> str:
    """Returns where the trajectory stands, of the newest person's query, that has more of the first feature."""
    events = store.events(store.sessions()[-1].id)
    asked = next(
        e.payload for e in events if e.payload.get("first_shown") and e.payload["query_index"] == query_index
    )
    best = "a" if asked["query"]["features_a"][0] > asked["query"]["features_b"][0] else "b"
    return "first" if best == asked["first_shown"] else "second"


def arrived(store: Store, session_id: str) -> bytes:
    until = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until:
        model = store.personal_model(session_id, PERSONAL_NETWORK.kind)
        if model is not None:
            return model.content
        time.sleep(0.1)
    raise AssertionError("no model came")


@pytest.mark.slow
def test_whoever_finishes_is_learned_from_though_workers_die(tmp_path: Path) -> None:
    with running_server(tmp_path, study_in(tmp_path)) as server:
        answer_everything(server, "quickstart", _N_ACTIVE + 1)
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


@pytest.mark.slow
def test_a_served_session_goes_on_with_the_feature_that_its_answers_taught_though_workers_die(
    tmp_path: Path,
) -> None:
    with running_server(tmp_path, online_study_in(tmp_path)) as server:
        killer = threading.Timer(
            1.0, lambda: [kill_process(worker) for worker in server.children("dask_worker")]
        )
        killer.start()
        answer_everything(server, "online", 25)
        killer.join()
        database = server.database
    with open_store(database) as store:
        (record,) = store.sessions()
        study = parse_study(store.study_text(record.study_hash))
        events = [session_codec.from_json(event.kind, event.payload) for event in store.events(record.id)]
        widths = {one.query_index: one.samples.shape[1] for one in store.posteriors(record.id)}
    (learned,) = [event for event in events if isinstance(event, FeatureLearned)]
    before = reduce(study, events[: events.index(learned)])
    assert before.participant is not None
    assert (learned.query_index, learned.n_queries) == (15, 11)
    assert learned.feature == learn_feature(study, before.participant, 11, compared(before, 11))
    assert widths == {index: 4 if index < 15 else 5 for index in range(25)}


def test_the_next_person_starts_from_whoever_has_finished(tmp_path: Path) -> None:
    text = Path(study_in(tmp_path)).read_text().replace("rationality = 200.0", 'rationality = "inferred"')
    study_file = tmp_path / "before.toml"
    study_file.write_text(f"{text}\n[learning]\npeople_before = true\n")
    with running_server(tmp_path, str(study_file)) as server, open_store(server.database) as store:
        answer_everything(server, "quickstart", _N_ACTIVE + 1)
        (first,) = store.sessions()
        until = time.monotonic() + _PATIENCE_S
        while store.shared_model("quickstart", POPULATION) is None and time.monotonic() < until:
            time.sleep(0.1)
        answer_everything(server, "quickstart", 1)
        known = person(store, first)
        second = store.sessions()[1]
        events = [session_codec.from_json(event.kind, event.payload) for event in store.events(second.id)]
        alone, informed = (store.posteriors(record.id)[0].mean for record in (first, second))
    adopted = events[1]
    assert isinstance(adopted, PopulationAdopted)
    assert adopted.learned_from == (first.id,)
    expected = learn_population_prior(
        {first.id: ComparedFeatures.of(known.study.domain.features, known.training)}
    )
    assert adopted.population is not None
    assert expected is not None
    np.testing.assert_array_equal(adopted.population.mean, expected.mean)
    study = known.study.knowing(Knowledge(adopted.population))
    nothing = ComparisonSet.empty(len(study.domain.feature_names))
    again = infer_posterior(study, second.ordinal, 0, nothing).mean
    np.testing.assert_array_equal(informed, again)
    assert np.abs(informed - alone).max() > 0.05
