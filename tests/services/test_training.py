"""Whoever finishes is learned from, by a small real function, and nobody waits for it."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest
from typer.testing import CliRunner

from app import wiring
from app.cli import cli
from app.engine.on_demand import InlineEngine
from app.services import study as services
from app.services.people import person
from app.services.published import import_person, read_people
from app.services.runtime import Runtime
from app.services.training import Trainer, TrainingError, TrainingMethod, TrainingRequest
from app.settings import find_study
from app.store import Store, open_store
from app.training import PERSONAL_NETWORK
from study_core.domain import domain_named
from study_core.networks.checkpoint import from_bytes
from study_core.predictors.personal_network import PersonalNetwork, model_of
from tests.services.test_people import spoil_test_answers
from tests.support.published import write_person

QUICKSTART = find_study("quickstart")
_PATIENCE_S = 60.0


def fit_weights(request: TrainingRequest) -> bytes:
    """Hand-coded weights by ridge regression of the answers on the differences of features."""
    pairs, domain = request.training.pairs, domain_named(request.domain_id)
    diffs = domain.features(pairs.states_a) - domain.features(pairs.states_b)
    ridge = float(request.settings["ridge"]) * np.eye(4)
    weights: np.ndarray = np.linalg.solve(diffs.T @ diffs + ridge, diffs.T @ request.training.signs)
    return weights.tobytes()


def refuse_five(request: TrainingRequest) -> bytes:
    if request.participant == "published-5":
        raise ValueError("nothing can be learned from person 5")
    return fit_weights(request)


METHOD = TrainingMethod("weights", "ridge-1", {"ridge": 0.1}, 1, fit_weights)


@pytest.fixture
def trainer(store: Store) -> Iterator[Trainer]:
    with trainer_of(store, METHOD) as made:
        yield made


@contextmanager
def trainer_of(store: Store, method: TrainingMethod) -> Iterator[Trainer]:
    made = Trainer(store, InlineEngine(), method)
    yield made
    made.close()


@pytest.fixture
def imported(store: Store, tmp_path: Path) -> list[str]:
    """Two finished people; their session ids."""
    for number in (5, 9):
        write_person(tmp_path, number)
    people = read_people(tmp_path, lambda done, total: None)
    return [str(import_person(store, someone).session_id) for someone in people]


def arrived(store: Store, session_id: str) -> bytes:
    """Waits for a person's model."""
    until = monotonic() + _PATIENCE_S
    while monotonic() < until:
        model = store.personal_model(session_id, METHOD.kind)
        if model is not None:
            return model.content
        sleep(0.02)
    raise AssertionError("no model came")


def finish(runtime: Runtime, choices: str = "abbaabababba", rehearsal: str | None = None) -> str:
    _, record = services.join(runtime, QUICKSTART, rehearsal)
    for index, choice in enumerate(choices):
        services.answer(runtime, record.id, index, choice, 1000)
    return record.id


def expected_weights(store: Store, session_id: str) -> np.ndarray:
    """The same regression, from the stored queries."""
    events = [event.payload for event in store.events(session_id)]
    asked = [event["query"] for event in events if event.get("phase") == "active"]
    diffs = np.array([np.subtract(query["features_a"], query["features_b"]) for query in asked])
    choices = [event["choice"] for event in events if "choice" in event][: len(asked)]
    signs = np.array([1.0 if choice == "a" else -1.0 for choice in choices])
    stacked = np.vstack([diffs, np.sqrt(0.1) * np.eye(4)])
    return np.linalg.lstsq(stacked, np.append(signs, np.zeros(4)), rcond=None)[0]


def test_everyone_who_lacks_a_model_gets_one(store: Store, trainer: Trainer, imported: list[str]) -> None:
    told: list[int] = []
    missing = trainer.missing("katz2021-published")
    assert [record.id for record in missing] == imported
    trainer.train(missing, lambda: told.append(1))
    assert len(told) == 2
    for session_id in imported:
        model = store.personal_model(session_id, "weights")
        assert model is not None
        found = np.frombuffer(model.content)
        np.testing.assert_allclose(found, expected_weights(store, session_id), rtol=1e-9)
        assert model.lineage["sessions"] == [session_id]
        assert model.lineage["version"] == "ridge-1"
        assert model.lineage["settings"] == {"ridge": 0.1}
        assert model.lineage["n_answers"] == 6
    assert trainer.missing() == []


def test_a_person_who_has_just_answered_the_last_query_is_learned_from(database_url: str) -> None:
    with wiring.headless(database_url) as runtime, trainer_of(runtime.store, METHOD) as trainer:
        runtime.trainer = trainer
        session_id = finish(runtime)
        weights = np.frombuffer(arrived(runtime.store, session_id))
        np.testing.assert_allclose(weights, expected_weights(runtime.store, session_id), rtol=1e-9)


def test_the_last_page_does_not_wait_for_the_model(database_url: str) -> None:
    may_go_on = threading.Event()

    def slow(request: TrainingRequest) -> bytes:
        assert may_go_on.wait(_PATIENCE_S)
        return fit_weights(request)

    with (
        wiring.headless(database_url) as runtime,
        trainer_of(runtime.store, replace(METHOD, train=slow)) as trainer,
    ):
        runtime.trainer = trainer
        session_id = finish(runtime)
        assert services.screen(runtime, session_id).kind == "finished"
        assert runtime.store.personal_model(session_id, "weights") is None
        may_go_on.set()
        arrived(runtime.store, session_id)


def test_who_is_under_way_or_rehearsed_is_not_learned_from(database_url: str) -> None:
    with wiring.headless(database_url) as runtime:
        finish(runtime, choices="abba")
        finish(runtime, rehearsal="rehearsal-1")
        with trainer_of(runtime.store, METHOD) as trainer:
            assert trainer.missing() == []


def test_a_restart_finds_what_is_missing(store: Store, database_url: str, imported: list[str]) -> None:
    with trainer_of(store, METHOD) as trainer:
        trainer.train([store.session(imported[0])], lambda: None)
    with open_store(database_url) as again, trainer_of(again, METHOD) as trainer:
        assert [record.id for record in trainer.missing()] == imported[1:]
        trainer.begin_missing("katz2021-published")
        arrived(again, imported[1])


@pytest.mark.parametrize(
    "change", [{"version": "ridge-2"}, {"settings": {"ridge": 0.2}}], ids=["version", "settings"]
)
def test_a_model_of_another_version_or_of_other_settings_is_trained_again(
    store: Store, trainer: Trainer, imported: list[str], change: dict[str, object]
) -> None:
    trainer.train(trainer.missing(), lambda: None)
    before = store.personal_model(imported[0], "weights")
    with trainer_of(store, replace(METHOD, **change)) as other:  # type: ignore[arg-type]
        assert len(other.missing()) == 2
        other.train(other.missing(), lambda: None)
        assert other.missing() == []
    after = store.personal_model(imported[0], "weights")
    assert before is not None
    assert after is not None
    assert before.key != after.key


def test_nothing_of_a_test_answer_comes_into_a_model(
    store: Store, trainer: Trainer, imported: list[str], database_url: str
) -> None:
    trainer.train(trainer.missing(), lambda: None)
    spoil_test_answers(database_url, 6)
    assert trainer.missing() == []


def test_a_model_that_comes_after_its_person_was_deleted_is_not_kept(
    store: Store, imported: list[str]
) -> None:
    def delete_first(request: TrainingRequest) -> bytes:
        store.delete_session(imported[0])
        return fit_weights(request)

    with trainer_of(store, replace(METHOD, train=delete_first)) as trainer:
        trainer.train([store.session(imported[0])], lambda: None)
        trainer.begin(imported[0])
        trainer.begin_missing("nothing of that name")
    assert [record.id for record in store.sessions()] == imported[1:]


def test_one_who_cannot_be_learned_from_does_not_keep_the_others_from_it(
    store: Store, imported: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    with (
        trainer_of(store, replace(METHOD, train=refuse_five)) as trainer,
        caplog.at_level(logging.ERROR),
        pytest.raises(TrainingError, match="1 of 2 models could not be trained"),
    ):
        trainer.train(trainer.missing(), lambda: None)
    assert "nothing can be learned from person 5" in caplog.text
    assert store.personal_model(imported[0], "weights") is None
    assert store.personal_model(imported[1], "weights") is not None


@pytest.fixture
def talkative(store: Store, tmp_path: Path) -> list[str]:
    """Two people who have answered enough for networks, and one who hasn't; the session ids of the two."""
    for number, n_active in ((3, 14), (4, 12), (6, 9)):
        write_person(tmp_path, number, n_active=n_active)
    people = read_people(tmp_path, lambda done, total: None)
    return [str(import_person(store, someone).session_id) for someone in people][:2]


def assert_networks_are_the_predictor_s(store: Store, session_id: str) -> None:
    known = person(store, store.session(session_id))
    record = store.personal_model(session_id, PERSONAL_NETWORK.kind)
    assert record is not None
    name = str(known.participant)
    fitted = PersonalNetwork().fit(known.study.seed, known.study.domain, {name: known.training})
    np.testing.assert_array_equal(
        model_of(from_bytes(record.content)).probability_of_a(known.training.pairs),
        fitted.people[name].probability_of_a(known.training.pairs),
    )


def test_networks_are_trained_in_other_processes_as_the_predictor_trains_them(
    store: Store, database_url: str, talkative: list[str]
) -> None:
    with wiring.training(database_url, n_workers=2) as trainer:
        missing = trainer.missing()
        assert [record.id for record in missing] == talkative
        trainer.train(missing, lambda: None)
    for session_id in talkative:
        assert_networks_are_the_predictor_s(store, session_id)


def test_the_command_trains_whoever_lacks_a_model(database_url: str, talkative: list[str]) -> None:
    command = ["train", "--database", database_url, "--workers", "1", "--study", "katz2021-published"]
    said = [CliRunner().invoke(cli, command).stdout for _ in range(2)]
    assert "Trained the models of 2 people of katz2021-published." in said[0]
    assert "Nobody of katz2021-published with enough answers lacks a model." in said[1]


def request_of(store: Store, session_id: str) -> TrainingRequest:
    known = person(store, store.session(session_id))
    assert known.participant is not None
    return TrainingRequest(
        "weights", "1", {"a": 1, "b": 2}, "driving-v1", 0, known.participant, known.training
    )


def test_equal_requests_have_one_key_and_different_ones_have_two(store: Store, imported: list[str]) -> None:
    one = request_of(store, imported[0])
    assert replace(one, settings={"b": 2, "a": 1}).key == one.key
    training = one.training
    others = [
        replace(one, kind="network"),
        replace(one, version="2"),
        replace(one, settings={"a": 1, "b": 3}),
        replace(one, seed=1),
        replace(one, participant=5),
        replace(one, domain_id="driving-v2"),
        replace(one, training=replace(training, signs=-training.signs)),
        replace(one, training=replace(training, stored_mean=None)),
        replace(one, training=training.first(3)),
    ]
    assert len({request.key for request in (one, *others)}) == 1 + len(others)
    assert json.dumps(one.key)
