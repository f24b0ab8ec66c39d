"""What an export holds."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from app import wiring
from app.services import path
from app.services import study as services
from app.services.export import ExportError, export
from app.services.rehearsal import rehearse
from app.services.rehearsed_person import Crowd
from app.services.replay import ReplayDifferenceError, read_scripts, replay
from app.services.walk import walk
from app.settings import find_study
from app.store import ExternalPerson, NewEvent, Source, Store, open_store
from study_core.errors import ScriptError
from study_core.events import AnswerGiven, QueryPrepared
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
        begun = NewEvent("session_begun", {"participant": 1})
        stopped = NewEvent("session_ended", {"ending": "stopped"})
        store.append(session.id, 0, [begun, stopped], ending="stopped")
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


FULL_PATH = find_study("full-path")
MEASURES = {
    "replays": 2,
    "viewport": [1280, 720],
    "frame_ms": 16.7,
    "means": "key",
    "pauses": {"odd": 1},
    "zoom": 2,
}


@pytest.fixture(scope="module")
def on_the_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Somebody who goes on in German, takes an answer back and chooses by position alone; another declines."""
    folder = tmp_path_factory.mktemp("on-the-path")
    with wiring.headless(f"sqlite:///{folder / 'study.db'}") as runtime:
        _, record = services.join(runtime, FULL_PATH, rehearsal="changes their mind")
        path.take_step(runtime, record.id, 0, {"accept": ["yes"]})
        path.choose_language(runtime, record.id, "de")
        path.take_step(runtime, record.id, 1, {"sees-animations": ["yes"]})
        path.take_step(runtime, record.id, 2, {})
        services.answer(runtime, record.id, 0, "a", 900, MEASURES, confidence=2)
        path.take_back(runtime, record.id, 0)
        walk(runtime, record.id, changeable)
        _, other = services.join(runtime, FULL_PATH, rehearsal="declines")
        path.take_step(runtime, other.id, 0, {"accept": ["no"]})
        export(runtime.store, folder / "jsonl", "jsonl", "all", lambda: None)
        export(runtime.store, folder / "csv", "csv", "all", lambda: None)
    return folder


def changeable(query: QueryPrepared) -> AnswerGiven:
    """Always the first position: who does so never agrees with themselves when sides are swapped."""
    assert query.first_shown is not None
    return AnswerGiven(query.query_index, query.first_shown, 700, 4)


def test_people_say_how_they_ended_and_whether_they_agree_with_themselves(on_the_path: Path) -> None:
    walked, declined = rows(on_the_path / "jsonl" / "people.jsonl")
    assert (walked["ending"], walked["language"], walked["is_finished"]) == ("completed", "de", True)
    assert (walked["n_answers"], walked["n_repeats"], walked["n_repeats_agreed"]) == (14, 2, 0)
    queries = rows(on_the_path / "jsonl" / "queries.jsonl")
    (told,) = [row["instructed"] for row in queries if row["phase"] == "check"]
    assert (walked["n_checks"], walked["n_checks_passed"]) == (1, int(told == "first"))
    assert (declined["ending"], declined["language"], declined["n_answers"]) == ("declined", "en", 0)


def test_steps_say_what_was_read_and_responses_what_was_answered(on_the_path: Path) -> None:
    steps = rows(on_the_path / "jsonl" / "steps.jsonl")
    assert [row["kind"] for row in steps[:4]] == ["consent", "questionnaire", "instructions", "practice"]
    assert [row["language"] for row in steps[:3]] == ["en", "de", "de"]
    assert steps[2]["text_sha256"] == FULL_PATH.text_hash("instructions", "de")
    assert [row["outcome"] for row in steps] == ["done"] * 9 + ["declined"]
    responses = rows(on_the_path / "jsonl" / "responses.jsonl")
    asked = [(row["questionnaire"], row["item"]) for row in responses]
    names = ["screening", "comprehension", "nasa-tlx", "demographics", "closing"]
    expected = [(name, item.name) for name in names for item in FULL_PATH.file.questionnaire[name]]
    assert asked == expected
    assert responses[0]["value"] == "yes"


def test_an_answer_taken_back_stays_and_is_marked(on_the_path: Path) -> None:
    answers = rows(on_the_path / "jsonl" / "answers.jsonl")
    assert [row["is_taken_back"] for row in answers] == [True] + [False] * 14
    assert [row["query_index"] for row in answers] == [0, *range(14)]
    queries = rows(on_the_path / "jsonl" / "queries.jsonl")
    # Query 1 was prepared after the answer that was taken back, and again after the one that stands.
    assert [(row["query_index"], row["is_taken_back"]) for row in queries[:3]] == [
        (0, False),
        (1, True),
        (1, False),
    ]
    sides = {row["query_index"]: row["first_shown"] for row in queries}
    for row in answers:
        assert row["position_chosen"] == ("first" if row["choice"] == sides[row["query_index"]] else "second")
    assert [row["confidence"] for row in answers] == [2] + [4] * 14


def test_measures_have_their_columns_whatever_a_browser_sends(on_the_path: Path) -> None:
    (measured,) = rows(on_the_path / "jsonl" / "measures.jsonl")
    assert (measured["replays"], measured["viewport"], measured["means"]) == (2, [1280, 720], "key")
    assert (measured["pauses"], measured["scrubs"]) == (None, None)
    assert measured["other"] == {"pauses": {"odd": 1}, "zoom": 2}
    with (on_the_path / "csv" / "measures.csv").open() as file:
        (flat,) = csv.DictReader(file)
    assert (flat["replays"], flat["viewport"], flat["pauses"]) == ("2", "[1280, 720]", "")


def test_every_table_has_as_many_rows_as_csv(on_the_path: Path) -> None:
    tables = ("people", "steps", "responses", "queries", "answers", "measures", "posteriors", "events")
    assert {file.stem for file in (on_the_path / "csv").glob("*.csv")} == set(tables)
    for table in tables:
        with (on_the_path / "csv" / f"{table}.csv").open() as file:
            assert len(list(csv.DictReader(file))) == len(rows(on_the_path / "jsonl" / f"{table}.jsonl"))


def test_an_export_of_a_version_that_drew_no_sides_is_still_derived_again(exported: Path) -> None:
    log = rows(exported / "events.jsonl")
    for row in log:
        if row["kind"] == "query_prepared":
            content: dict[str, object] = row["payload"]  # type: ignore[assignment]
            for key in ("first_shown", "repeat_of", "instructed"):
                del content[key]
            # What the clips looked like when A always came first.
            content["clips"] = dict.fromkeys(content["clips"], "0" * 64)  # type: ignore[attr-defined]
    (exported / "events.jsonl").write_text("\n".join(json.dumps(row) for row in log))
    with wiring.headless() as runtime:
        for script in read_scripts(exported):
            replay(runtime, script)
