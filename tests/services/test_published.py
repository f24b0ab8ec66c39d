"""The published study's people in the store, and what the other services make of them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from app import wiring
from app.services import study as services
from app.services.export import ExportOptions, export, open_export
from app.services.published import ImportedPerson, import_person, read_people
from app.services.replay import survey
from app.settings import find_study
from app.store import Source, Store
from study_core import session_codec
from study_core.errors import PublishedDataError, ScriptError
from study_core.evaluation.metrics import accuracy
from study_core.session import Action, next_action, reduce
from study_core.study import parse_study
from tests.support.exports import replayed
from tests.support.published import write_person


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three people: one whose file lost its dot, one who stopped early, one with a posterior too many."""
    made = tmp_path / "published"
    made.mkdir()
    write_person(made, 10, training_name="train{}jld2")
    write_person(made, 5, n_active=4)
    write_person(made, 15, n_samples=7)
    return made


def imported(store: Store, folder: Path) -> list[ImportedPerson]:
    return [import_person(store, person) for person in read_people(folder, lambda done, total: None)]


def test_everyone_becomes_a_finished_session_that_no_link_opens(store: Store, folder: Path) -> None:
    done = imported(store, folder)
    assert [(one.number, one.n_active, one.n_test) for one in done] == [(5, 4, 3), (10, 6, 3), (15, 6, 3)]
    for one in done:
        assert one.session_id is not None
        record = store.session(one.session_id)
        assert record.source is Source.IMPORTED
        study = parse_study(store.study_text(record.study_hash))
        assert study.name == "katz2021-published"
        state = reduce(
            study, (session_codec.from_json(event.kind, event.payload) for event in store.events(record.id))
        )
        assert next_action(study, state) is Action.FINISHED
    assert len(store.sessions_of_study_named("katz2021-published")) == 3


def test_posteriors_stand_at_the_query_that_was_chosen_from_them(store: Store, tmp_path: Path) -> None:
    content = write_person(tmp_path, 15, n_samples=7)
    (done,) = imported(store, tmp_path)
    assert done.session_id is not None
    posteriors = store.posteriors(done.session_id)
    assert [posterior.query_index for posterior in posteriors] == list(range(6))
    np.testing.assert_array_equal(posteriors[-1].samples, content["samples"][-1])
    np.testing.assert_allclose(posteriors[-1].mean, content["samples"][-1].mean(axis=0))
    assert posteriors[-1].summary["has_converged"] is None
    assert posteriors[-1].summary["rationality"]["median"] == 1.0


def test_importing_again_changes_nothing_and_says_so(store: Store, folder: Path) -> None:
    first = imported(store, folder)
    before = [store.events(record.id) for record in store.sessions()]
    again = imported(store, folder)
    assert [one.session_id for one in again] == [None, None, None]
    assert [one.files for one in again] == [one.files for one in first]
    assert [store.events(record.id) for record in store.sessions()] == before


def test_somebody_more_is_added_to_those_who_are_there(store: Store, folder: Path) -> None:
    imported(store, folder)
    write_person(folder, 2)
    assert [one.number for one in imported(store, folder) if one.session_id] == [2]
    assert len(store.sessions()) == 4


def test_one_damaged_file_keeps_everybody_out(folder: Path) -> None:
    damaged = folder / "train15.jld2"
    damaged.write_bytes(damaged.read_bytes()[:3000])
    with pytest.raises(PublishedDataError, match=r"Can't read \S*train15\.jld2"):
        read_people(folder, lambda done, total: None)


def test_reading_is_told_as_it_goes_on(folder: Path) -> None:
    told: list[tuple[int, int]] = []
    read_people(folder, lambda done, total: told.append((done, total)))
    assert told == [(1, 3), (2, 3), (3, 3)]


def rows(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_an_export_holds_imported_people_beside_our_own(
    database_url: str, folder: Path, tmp_path: Path
) -> None:
    with wiring.headless(database_url) as runtime:
        imported(runtime.store, folder)
        _, record = services.join(runtime, find_study("quickstart"))
        services.answer(runtime, record.id, 0, "a", 1234)
        for form in ("jsonl", "csv"):
            assert export(runtime.store, tmp_path / form, ExportOptions(form, "all")) == 4  # type: ignore[arg-type]
        assert export(runtime.store, tmp_path / "ours", ExportOptions("csv", "real")) == 1
        assert export(runtime.store, tmp_path / "theirs", ExportOptions("csv", "imported")) == 3
    people = rows(tmp_path / "jsonl" / "people.jsonl")
    assert [row["source"] for row in people] == ["imported"] * 3 + ["joined"]
    assert [row["is_finished"] for row in people] == [True] * 3 + [False]
    queries = rows(tmp_path / "jsonl" / "queries.jsonl")
    assert {tuple(row) for row in queries} == {tuple(queries[0])}
    assert {row["method"] for row in queries} == {"imported", "information-gain-realistic"}
    assert {row["imported_file"] for row in queries if row["person_id"] == people[1]["person_id"]} == {
        "train10jld2",
        "test10.jld2",
    }
    for table in ("people", "queries", "answers", "posteriors", "events"):
        with (tmp_path / "csv" / f"{table}.csv").open() as file:
            flat = list(csv.DictReader(file))
        assert len(flat) == len(rows(tmp_path / "jsonl" / f"{table}.jsonl"))
        assert None not in flat[0]


def test_imported_people_are_left_out_of_a_replay_and_named(
    store: Store, folder: Path, tmp_path: Path
) -> None:
    imported(store, folder)
    export(store, tmp_path / "theirs", ExportOptions("jsonl", "all"))
    with pytest.raises(ScriptError, match=r"found nobody.* another program chose the queries") as refused:
        replayed(tmp_path / "theirs")
    assert "\n" not in str(refused.value)
    with wiring.headless("sqlite:///" + str(tmp_path / "study.db")) as runtime:
        _, record = services.join(runtime, find_study("quickstart"))
        services.answer(runtime, record.id, 0, "a", 1234)
        export(runtime.store, tmp_path / "all", ExportOptions("jsonl", "all"))
    known = survey(open_export(tmp_path / "all"))
    assert (known.n_people, len(known.left_out)) == (1, 3)
    assert all("imported person" in each for each in known.left_out)
    assert [each.n_queries for each in replayed(tmp_path / "all")] == [2]


def test_made_up_people_answer_by_the_weights_they_were_made_with(store: Store, folder: Path) -> None:
    (first, *_) = read_people(folder, lambda done, total: None)
    state = reduce(first.study, first.events)
    assert accuracy(np.array([0.2, 0.5, 0.3, 0.8]), state.comparisons) == 1.0
