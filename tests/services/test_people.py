"""What people taught comes back for learning, and their test answers only for the evaluation."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from app import wiring
from app.services import people
from app.services import study as services
from app.services.held_out import held_out
from app.services.published import import_person, read_people
from app.settings import find_study
from app.store import SessionRecord, Store
from study_core.predictors.predictor import Training
from study_core.study import parse_study
from tests.study_core import references
from tests.support.published import write_person


@pytest.fixture
def content(tmp_path: Path) -> dict[str, np.ndarray]:
    return write_person(tmp_path, 7)


@pytest.fixture
def record(store: Store, content: dict[str, np.ndarray], tmp_path: Path) -> SessionRecord:
    """An imported person, of whom the files say everything."""
    (someone,) = read_people(tmp_path, lambda done, total: None)
    import_person(store, someone)
    return store.sessions()[0]


def spoil_test_answers(database_url: str, n_active: int) -> None:
    """Makes every answer to a test query unreadable, and every test query with it."""
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as rows, rows:
        of_query = "coalesce(prepared_query, answered_query)"
        changed = rows.execute(f"UPDATE events SET payload = 'spoilt' WHERE {of_query} >= ?", (n_active,))
        assert changed.rowcount > 0


def test_training_is_what_the_files_say(
    store: Store, record: SessionRecord, content: dict[str, np.ndarray]
) -> None:
    someone = people.person(store, record)
    training = someone.training
    assert (someone.participant, someone.study.name) == ("published-7", "katz2021-published")
    np.testing.assert_allclose(training.pairs.states_a, content["active_states"][:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(training.pairs.states_b, content["active_states"][:, 1], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(training.signs, content["active_signs"])
    np.testing.assert_allclose(training.stored_mean, content["samples"][-1].mean(axis=0))
    assert people.is_finished(store, record)


def test_test_answers_are_what_the_files_say(
    store: Store, record: SessionRecord, content: dict[str, np.ndarray]
) -> None:
    found = held_out(store, record)
    np.testing.assert_allclose(found.pairs.states_a, content["test_states"][:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.pairs.states_b, content["test_states"][:, 1], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(found.signs, content["test_signs"])


def test_learning_reads_no_test_answer(store: Store, record: SessionRecord, database_url: str) -> None:
    before = people.person(store, record).training
    spoil_test_answers(database_url, 6)
    assert same(people.person(store, record).training, before)
    assert people.is_finished(store, record)
    with pytest.raises(json.JSONDecodeError):
        held_out(store, record)


def same(one: Training, other: Training) -> bool:
    return all(
        np.array_equal(first, second)
        for first, second in (
            (one.pairs.states_a, other.pairs.states_a),
            (one.pairs.states_b, other.pairs.states_b),
            (one.signs, other.signs),
            (one.stored_mean, other.stored_mean),
        )
    )


def test_somebody_under_way_has_taught_what_they_preferred_so_far(database_url: str) -> None:
    offered = 'answers = ["a", "b", "same", "skip"]\ntie_threshold = 1.0'
    study = parse_study(find_study("quickstart").text.replace("[response]", f"[response]\n{offered}"))
    with wiring.headless(database_url) as runtime:
        _, record = services.join(runtime, study)
        before = people.person(runtime.store, record).training
        assert (len(before), before.pairs.states_a.shape) == (0, (0, 50, 4))
        for index, choice in enumerate(("b", "skip", "same", "a")):
            services.answer(runtime, record.id, index, choice, 1000)
        training = people.person(runtime.store, record).training
        assert training.signs.tolist() == [-1.0, 1.0]
        asked = runtime.live(record.id).state.prepared
        for row, index in enumerate((0, 3)):
            expected = references.drive(
                references.ROBOT_START, asked[index].proposed.query.controls_b.tolist()
            )
            np.testing.assert_allclose(training.pairs.states_b[row], expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(training.stored_mean, runtime.store.posteriors(record.id)[-1].mean)
        assert not people.is_finished(runtime.store, record)
        assert len(held_out(runtime.store, record).signs) == 0
