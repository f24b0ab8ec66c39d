"""What an export holds."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from app import wiring
from app.services import study as services
from app.services.export import ExportError, export
from app.services.rehearsal import Crowd, rehearse
from app.services.replay import ReplayDifferenceError, read_scripts, replay
from app.settings import find_study
from app.store import ExternalPerson, NewEvent, Source, Store, open_store
from study_core.errors import ScriptError
from study_core.study import parse_study

QUICKSTART = find_study("quickstart")


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Two rehearsed people who finished, and a real one who left after two answers."""
    url = f"sqlite:///{tmp_path_factory.mktemp('export') / 'study.db'}"
    with wiring.headless(url) as runtime:
        for number in (1, 2):
            rehearse(runtime, QUICKSTART, Crowd(5, 2), number, lambda: None)
        _, record = services.join(runtime, QUICKSTART)
        services.answer(runtime, record.id, 0, "a", 1234)
        services.answer(runtime, record.id, 1, "b", 2345)
    return url


@pytest.fixture
def exported(database: str, tmp_path: Path) -> Path:
    with open_store(database) as store:
        assert export(store, tmp_path / "out", "jsonl", "all", lambda: None) == 3
    return tmp_path / "out"


def rows(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_each_table_has_one_row_a_thing(exported: Path) -> None:
    assert len(rows(exported / "people.jsonl")) == 3
    assert len(rows(exported / "answers.jsonl")) == 12 + 12 + 2
    assert len(rows(exported / "queries.jsonl")) == 12 + 12 + 3
    assert len(rows(exported / "posteriors.jsonl")) == 9 + 9 + 3
    people = {row["person_id"] for row in rows(exported / "people.jsonl")}
    assert {row["person_id"] for row in rows(exported / "events.jsonl")} == people


def test_answers_keep_their_response_times_and_people_say_whether_they_finished(exported: Path) -> None:
    real = next(row for row in rows(exported / "people.jsonl") if row["source"] == "joined")
    assert (real["is_finished"], real["n_answers"]) == (False, 2)
    answers = [row for row in rows(exported / "answers.jsonl") if row["person_id"] == real["person_id"]]
    assert [(row["choice"], row["response_time_ms"]) for row in answers] == [("a", 1234), ("b", 2345)]


def test_people_are_who_their_links_said_they_are(database_url: str, tmp_path: Path) -> None:
    with open_store(database_url) as store:
        store.put_study(QUICKSTART.hash, QUICKSTART.name, QUICKSTART.text)
        person = ExternalPerson("quickstart", "a-pid", {"STUDY_ID": "a-study"})
        session = store.create_session(QUICKSTART.hash, "token", Source.JOINED, None, person)
        given, taken_back = (
            NewEvent(kind, {"query_index": 0}) for kind in ("answer_given", "answer_taken_back")
        )
        store.append(session.id, 0, [given, taken_back], ending="stopped")
        store.create_session(QUICKSTART.hash, "another", Source.JOINED)
        for form in ("jsonl", "csv"):
            export(store, tmp_path / form, form, "all", lambda: None)
    known, unknown = rows(tmp_path / "jsonl" / "people.jsonl")
    assert (known["external_id"], known["other_ids"]) == ("a-pid", {"STUDY_ID": "a-study"})
    assert (known["ending"], known["n_answers"]) == ("stopped", 0)
    assert (unknown["external_id"], unknown["other_ids"], unknown["ending"]) == (None, {}, None)
    with (tmp_path / "csv" / "people.csv").open() as file:
        assert [json.loads(row["other_ids"]) for row in csv.DictReader(file)] == [{"STUDY_ID": "a-study"}, {}]


def test_queries_hold_controls_features_and_provenance(exported: Path) -> None:
    query = rows(exported / "queries.jsonl")[0]
    assert len(query["controls_a"]) == 10  # type: ignore[arg-type]
    assert set(query["features_a"]) == {"lane", "speed", "heading", "collision"}  # type: ignore[call-overload]
    for key in (
        "seed",
        "weights_a",
        "weights_b",
        "score",
        "study_hash",
        "code_version",
        "compute_ms",
        "method",
    ):
        assert key in query
    study_file = exported / "studies" / f"{query['study_hash']}.toml"
    assert study_file.read_text() == QUICKSTART.text


def test_posteriors_name_what_was_inferred_and_say_whether_to_trust_it(tmp_path: Path) -> None:
    text = QUICKSTART.text.replace("rationality = 200.0", 'rationality = "inferred"')
    with wiring.headless(f"sqlite:///{tmp_path / 'inferred.db'}") as runtime:
        _, record = services.join(runtime, parse_study(text))
        services.answer(runtime, record.id, 0, "a", 1234)
        export(runtime.store, tmp_path / "out", "jsonl", "real", lambda: None)
    first, second = rows(tmp_path / "out" / "posteriors.jsonl")
    for row in (first, second):
        assert list(row["r_hat"]) == ["lane", "speed", "heading", "collision", "rationality"]  # type: ignore[call-overload]
        assert row["has_converged"] is True
        assert row["warning"] is None
        assert row["n_draws"] >= 3000  # type: ignore[operator]
        assert row["lapse_rate"] == {"q05": 0.1, "median": 0.1, "q95": 0.1}
        low, middle, high = (row["rationality"][key] for key in ("q05", "median", "q95"))  # type: ignore[index,call-overload]
        assert low < middle / 2 < 2 * middle < high


def test_csv_holds_the_same_rows_with_a_column_a_number(
    database: str, exported: Path, tmp_path: Path
) -> None:
    with open_store(database) as store:
        export(store, tmp_path / "csv", "csv", "all", lambda: None)
    for table in ("people", "queries", "answers", "posteriors", "events"):
        with (tmp_path / "csv" / f"{table}.csv").open() as file:
            flat = list(csv.DictReader(file))
        nested = rows(exported / f"{table}.jsonl")
        assert len(flat) == len(nested)
    with (tmp_path / "csv" / "queries.csv").open() as file:
        first = next(csv.DictReader(file))
    query = rows(exported / "queries.jsonl")[0]
    assert float(first["controls_a_3"]) == query["controls_a"][3]  # type: ignore[index]
    assert float(first["features_b_lane"]) == query["features_b"]["lane"]  # type: ignore[index,call-overload]


def test_rehearsed_people_are_left_out_unless_asked_for(database: str, tmp_path: Path) -> None:
    with open_store(database) as store:
        assert export(store, tmp_path / "joined", "csv", "real", lambda: None) == 1
        assert export(store, tmp_path / "rehearsed", "csv", "rehearsed", lambda: None) == 2


def test_an_export_never_overwrites(database: str, exported: Path) -> None:
    with open_store(database) as store, pytest.raises(ExportError, match="not empty"):
        export(store, exported, "csv", "all", lambda: None)


def test_an_export_of_nobody_says_so(store: Store, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="Expected real people"):
        export(store, tmp_path / "out", "csv", "real", lambda: None)
    assert not (tmp_path / "out").exists()


def test_an_export_replays_to_the_same_queries(exported: Path) -> None:
    with wiring.headless() as runtime:
        summaries = [replay(runtime, script) for script in read_scripts(exported)]
    assert sorted(len(summary["queries"]) for summary in summaries) == [2, 12, 12]


def test_a_number_changed_in_an_export_is_named(exported: Path) -> None:
    log = rows(exported / "events.jsonl")
    victim = next(
        row for row in log if row["kind"] == "query_prepared" and row["payload"]["query_index"] == 3
    )  # type: ignore[index]
    controls = victim["payload"]["query"]["controls_b"]  # type: ignore[index]
    controls[4] += 1e-12
    (exported / "events.jsonl").write_text("\n".join(json.dumps(row) for row in log))
    with wiring.headless() as runtime, pytest.raises(ReplayDifferenceError) as caught:
        _ = [replay(runtime, script) for script in read_scripts(exported)]
    assert str(victim["person_id"]) in str(caught.value)
    assert "query 3" in str(caught.value)
    assert "controls_b[4]" in str(caught.value)


def test_a_folder_that_is_no_export_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match=r"people\.jsonl"):
        list(read_scripts(tmp_path))
