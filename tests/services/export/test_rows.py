"""What the tables say about people."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from app.services.export import Export, ExportOptions, export, open_export
from app.store import Source, Store, open_store
from study_core.study import Study
from tests.services.export.people import FULL_PATH, INFERRED, MEASURES, PROLIFIC, QUICKSTART


@pytest.fixture
def exported(exports: dict[str, Export]) -> Export:
    return exports["parquet"]


def of_study(exported: Export, table: str, study: Study) -> list[dict]:
    return [row for row in exported.rows(table) if row["study_hash"] == study.hash]


def test_each_table_has_one_row_a_thing(exported: Export) -> None:
    assert [row["study"] for row in exported.people()] == ["quickstart"] * 3 + ["full-path"] * 2 + [
        "inferred",
        "quickstart",
    ]
    assert len(of_study(exported, "answers", QUICKSTART)) == 12 + 12 + 2
    assert len(of_study(exported, "queries", QUICKSTART)) == 12 + 12 + 3
    assert len(of_study(exported, "posteriors", QUICKSTART)) == 9 + 9 + 3
    people = [row["person_id"] for row in exported.people()]
    assert list(dict.fromkeys(row["person_id"] for row in exported.rows("events"))) == people


def test_answers_keep_their_response_times_and_people_say_whether_they_finished(exported: Export) -> None:
    real = next(row for row in exported.people() if row["source"] == "joined")
    assert (real["is_finished"], real["n_answers"]) == (False, 2)
    answers = [row for row in exported.rows("answers") if row["person_id"] == real["person_id"]]
    assert [(row["choice"], row["response_time_ms"]) for row in answers] == [("a", 1234), ("b", 2345)]


def test_people_are_who_their_links_said_they_are(exported: Export) -> None:
    *others, sent = exported.people()
    assert (sent["external_id"], sent["other_ids"]) == (PROLIFIC.external_id, PROLIFIC.other_ids)
    assert (sent["ending"], sent["n_answers"]) == ("stopped", 0)
    assert {(row["external_id"], str(row["other_ids"])) for row in others} == {(None, "{}")}


def test_people_say_what_was_decided_about_them(exported: Export) -> None:
    told = [(row["verdict"], row["verdict_reason"]) for row in exported.people()]
    assert told[2] == ("excluded", "Left (5f1a-prolific-pid told so).")
    assert {*told[:2], *told[3:]} == {(None, None)}


def test_people_say_how_they_ended_and_whether_they_agree_with_themselves(exported: Export) -> None:
    walked, declined = of_study(exported, "people", FULL_PATH)
    assert (walked["ending"], walked["language"], walked["is_finished"]) == ("completed", "de", True)
    assert (walked["n_answers"], walked["n_repeats"], walked["n_repeats_agreed"]) == (14, 2, 0)
    (told,) = [row["instructed"] for row in exported.rows("queries") if row["phase"] == "check"]
    assert (walked["n_checks"], walked["n_checks_passed"]) == (1, int(told == "first"))
    assert (declined["ending"], declined["language"], declined["n_answers"]) == ("declined", "en", 0)


def test_queries_hold_controls_features_and_provenance_as_they_were_logged(exported: Export) -> None:
    query = next(exported.rows("queries"))
    logged = exported.events(query["person_id"])[query["position"]]["payload"]
    features = ("lane", "speed", "heading", "collision")
    for side in ("a", "b"):
        assert [query[f"controls_{side}_{i}"] for i in range(10)] == logged["query"][f"controls_{side}"]
        assert [query[f"features_{side}_{name}"] for name in features] == logged["query"][f"features_{side}"]
        assert [query[f"weights_{side}_{name}"] for name in features] == logged["provenance"][
            f"weights_{side}"
        ]
    for key in ("seed", "score", "stream", "versions", "method", "bank_digest", "visible_difference"):
        assert query[key] == logged["provenance"][key]
    for key in ("clips", "code_version", "compute_ms", "first_shown", "phase"):
        assert query[key] == logged[key]


def test_posteriors_name_what_was_inferred_and_say_whether_to_trust_it(exported: Export) -> None:
    first, second = of_study(exported, "posteriors", INFERRED)
    for row in (first, second):
        for name in ("lane", "speed", "heading", "collision", "rationality"):
            assert 0.9 < row[f"r_hat_{name}"] < 1.1
        assert (row["has_converged"], row["warning"], row["n_samples"]) == (True, None, 300)
        assert row["n_draws"] >= 3000
        assert {row[f"lapse_rate_{quantile}"] for quantile in ("q05", "median", "q95")} == {0.1}
        assert row["rationality_q05"] < row["rationality_median"] / 2 < row["rationality_q95"] / 4
    assert all(row["r_hat_rationality"] is None for row in of_study(exported, "posteriors", QUICKSTART))


def test_samples_are_those_that_the_store_keeps(exported: Export, database: str) -> None:
    with open_store(database) as store:
        for person in exported.people():
            for kept in store.posteriors(person["person_id"]):
                samples = exported.samples(person["person_id"], kept.query_index)
                np.testing.assert_array_equal(samples, kept.samples)


def test_only_the_last_samples_are_written_unless_more_are_wanted(
    database: str, exported: Export, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("samples")
    with open_store(database) as store:
        export(store, folder / "last", ExportOptions("parquet", "all"))
        export(store, folder / "none", ExportOptions("parquet", "all", samples="none"))
    last = {(row["person_id"], row["query_index"]) for row in open_export(folder / "last").rows("samples")}
    everything = [(row["person_id"], row["query_index"]) for row in exported.rows("posteriors")]
    assert last == set(dict(everything).items())
    assert "samples" not in open_export(folder / "none").tables


def test_models_are_files_named_by_their_digest(exported: Export) -> None:
    own, shared = exported.rows("networks")
    assert (own["kind"], own["key"], own["lineage"]["n_answers"]) == ("a-predictor", "k1", 2)
    assert (shared["kind"], shared["study"], shared["person_id"]) == ("of-all", "quickstart", None)
    for row, suffix in ((own, "safetensors"), (shared, "json")):
        content = (exported.folder / "networks" / f"{row['sha256']}.{suffix}").read_bytes()
        assert hashlib.sha256(content).hexdigest() == row["sha256"]
        assert len(content) == row["n_bytes"]


def test_studies_and_what_was_read_are_files(exported: Export) -> None:
    for study in (QUICKSTART, FULL_PATH, INFERRED):
        assert exported.study(study.hash).text == study.text
        for name in study.file.text:
            for language in study.languages:
                path = exported.folder / "texts" / study.hash / f"{name}.{language}.md"
                assert hashlib.sha256(path.read_bytes()).hexdigest() == study.text_hash(name, language)


def test_steps_say_what_was_read_and_responses_what_was_answered(exported: Export) -> None:
    steps = list(exported.rows("steps"))
    assert [row["kind"] for row in steps[:4]] == ["consent", "questionnaire", "instructions", "practice"]
    assert [row["language"] for row in steps[:3]] == ["en", "de", "de"]
    assert steps[2]["text_sha256"] == FULL_PATH.text_hash("instructions", "de")
    assert [row["outcome"] for row in steps] == ["done"] * 9 + ["declined"]
    responses = list(exported.rows("responses"))
    asked = [(row["questionnaire"], row["item"]) for row in responses]
    names = ["screening", "comprehension", "nasa-tlx", "demographics", "closing"]
    assert asked == [(name, item.name) for name in names for item in FULL_PATH.file.questionnaire[name]]
    assert responses[0]["value"] == "yes"


def test_an_answer_taken_back_stays_and_is_marked(exported: Export) -> None:
    answers = of_study(exported, "answers", FULL_PATH)
    assert [row["is_taken_back"] for row in answers] == [True] + [False] * 14
    assert [row["query_index"] for row in answers] == [0, *range(14)]
    assert [row["confidence"] for row in answers] == [2] + [4] * 14
    queries = of_study(exported, "queries", FULL_PATH)
    # Query 1 was prepared after the answer that was taken back, and again after the one that stands.
    told = [(row["query_index"], row["is_taken_back"]) for row in queries[:3]]
    assert told == [(0, False), (1, True), (1, False)]


def test_answers_say_the_side_as_shown_and_as_a_or_b_and_the_phase(exported: Export) -> None:
    asked = {(row["person_id"], row["query_index"]): row for row in exported.rows("queries")}
    for row in exported.rows("answers"):
        query = asked[row["person_id"], row["query_index"]]
        assert row["position_chosen"] == ("first" if row["choice"] == query["first_shown"] else "second")
        assert row["phase"] == query["phase"]


def test_measures_have_their_columns_whatever_a_browser_sends(exported: Export) -> None:
    (measured,) = exported.rows("measures")
    assert (measured["replays"], measured["viewport"], measured["means"]) == (2, [1280, 720], "key")
    assert (measured["pauses"], measured["scrubs"]) == (None, None)
    assert measured["other"] == {name: MEASURES[name] for name in ("pauses", "zoom")}


@pytest.mark.parametrize(("people", "n"), [("real", 3), ("rehearsed", 4)])
def test_people_are_left_out_unless_asked_for(
    database: str, tmp_path_factory: pytest.TempPathFactory, people: str, n: int
) -> None:
    with open_store(database) as store:
        out = tmp_path_factory.mktemp("people") / people
        assert export(store, out, ExportOptions("jsonl", people)) == n  # type: ignore[arg-type]


def test_one_study_can_be_exported_alone(database: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    out = tmp_path_factory.mktemp("one") / "out"
    with open_store(database) as store:
        assert export(store, out, ExportOptions("csv", "all", study="full-path")) == 2
    assert {row["study_hash"] for row in open_export(out).rows("events")} == {FULL_PATH.hash}


def test_somebody_deleted_while_others_are_written_is_left_out(
    store: Store, tmp_path_factory: pytest.TempPathFactory
) -> None:
    store.put_study(QUICKSTART.hash, QUICKSTART.name, QUICKSTART.text)
    ids = [store.create_session(QUICKSTART.hash, token, Source.JOINED).id for token in "abc"]
    out = tmp_path_factory.mktemp("deleted") / "out"

    def delete_the_second(done: int, total: int) -> None:
        if done == 1:
            store.delete_session(ids[1])

    assert export(store, out, ExportOptions(), delete_the_second) == 2
    assert [row["person_id"] for row in open_export(out).people()] == [ids[0], ids[2]]
