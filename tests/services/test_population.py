"""A session that starts from the people before, through the real services and a real store."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest
from typer.testing import CliRunner

from app import wiring
from app.cli import cli
from app.engine.on_demand import InlineEngine
from app.services import study as services
from app.services.export import ExportOptions, export, open_export
from app.services.people import person
from app.services.population import KIND, PopulationRequest, PopulationTrainer, adopted
from app.services.replay import ReplayDifferenceError, people_of
from app.services.runtime import Runtime
from app.settings import find_study
from app.store import Review, Store, Verdict, open_store
from app.training import fit_population
from study_core import session_codec
from study_core.events import PopulationAdopted
from study_core.predictors.hand_coded_population import learn_population_prior
from study_core.predictors.linear_people import ComparedFeatures
from study_core.queries import infer_posterior
from study_core.study import Study, parse_study
from tests.services.test_people import spoil_test_answers
from tests.support.exports import Json, edit, mend, replayed, rows

_PATIENCE_S = 60.0


def study_with_people_before() -> Study:
    """The quickstart study, which learns how each person answers and starts from the people before."""
    text = find_study("quickstart").text
    for line in text.splitlines():
        if line.startswith("rationality ="):
            text = text.replace(line, 'rationality = "inferred"')
    return parse_study(text + "\n[learning]\npeople_before = true\n")


STUDY = study_with_people_before()


@pytest.fixture
def runtime(database_url: str) -> Iterator[Runtime]:
    with wiring.headless(database_url) as opened, wiring.populations(opened.store) as populations:
        opened.populations = populations
        yield opened


def begin(runtime: Runtime, rehearsal: str | None = None) -> str:
    return services.join(runtime, STUDY, rehearsal)[1].id


def answer(runtime: Runtime, session_id: str, choices: str) -> None:
    for choice in choices:
        index = services.screen(runtime, session_id).query_index
        assert index is not None
        receipt = services.answer(runtime, session_id, index, choice, 1000)
        assert receipt.outcome is services.Outcome.TAKEN


def finish(runtime: Runtime, choices: str = "abbaabababba", rehearsal: str | None = None) -> str:
    session_id = begin(runtime, rehearsal)
    answer(runtime, session_id, choices)
    return session_id


def learned_from(store: Store, session_ids: list[str]) -> PopulationAdopted:
    """Waits until the stored model knows exactly these people."""
    until = monotonic() + _PATIENCE_S
    while monotonic() < until:
        found = adopted(store, STUDY)
        if found is not None and set(found.learned_from) == set(session_ids):
            return found
        sleep(0.02)
    raise AssertionError("what people have in common was not learned")


def adoption_of(store: Store, session_id: str) -> dict[str, object] | None:
    """What a session's log says of the people before."""
    payloads = [event.payload for event in store.events(session_id) if event.kind == "population_adopted"]
    return payloads[0] if payloads else None


def test_without_anybody_before_a_session_starts_from_the_study_files_prior(runtime: Runtime) -> None:
    session_id = begin(runtime)
    assert adoption_of(runtime.store, session_id) is None
    assert runtime.live(session_id).state.knowledge.population is None


def test_the_next_person_starts_from_everyone_who_has_finished(runtime: Runtime) -> None:
    first = finish(runtime)
    learned_from(runtime.store, [first])
    begin(runtime)
    finish(runtime, rehearsal="somebody simulated")
    second = finish(runtime, "babbaababaab")
    found = learned_from(runtime.store, [first, second])
    third = begin(runtime)
    stored = adoption_of(runtime.store, third)
    assert stored is not None
    assert (stored["key"], stored["learned_from"]) == (found.key, list(found.learned_from))
    kinds = [event.kind for event in runtime.store.events(third)]
    assert kinds == ["session_begun", "population_adopted", "query_prepared"]
    known = {one: person(runtime.store, runtime.store.session(one)).training for one in (first, second)}
    features = STUDY.domain.features
    expected = learn_population_prior({one: ComparedFeatures.of(features, known[one]) for one in known})
    assert found.population is not None
    assert expected is not None
    np.testing.assert_array_equal(found.population.mean, expected.mean)
    np.testing.assert_array_equal(found.population.covariance, expected.covariance)


def test_whoever_was_excluded_teaches_nobody(runtime: Runtime) -> None:
    first, second = finish(runtime), finish(runtime, "babbaababaab")
    learned_from(runtime.store, [first, second])
    runtime.store.desk.put_review(first, Review(Verdict.EXCLUDED, "asleep"), "ann")
    assert runtime.populations is not None
    runtime.populations.begin(STUDY)
    learned_from(runtime.store, [second])


def test_what_was_learned_moves_the_first_posterior(runtime: Runtime) -> None:
    first = finish(runtime)
    found = learned_from(runtime.store, [first])
    assert found.population is not None
    second = begin(runtime)
    alone, informed = (runtime.store.posteriors(one)[0].mean for one in (first, second))
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(found.population.mean, found.population.covariance, 400_000)
    kept = drawn[(drawn > 0).all(axis=1)]
    expected = (kept / np.linalg.norm(kept, axis=1, keepdims=True)).mean(axis=0)
    np.testing.assert_allclose(informed, expected, atol=0.04)
    np.testing.assert_allclose(alone, 0.45, atol=0.06)
    assert np.abs(alone - informed).max() > 0.02


def test_nothing_of_a_test_answer_comes_into_what_people_have_in_common(
    runtime: Runtime, database_url: str
) -> None:
    first = finish(runtime)
    learned_from(runtime.store, [first])
    assert runtime.populations is not None
    assert runtime.populations.missing() == []
    spoil_test_answers(database_url, STUDY.protocol.active_queries)
    assert runtime.populations.missing() == []


def test_many_who_finish_at_once_are_learned_by_one_run_more(runtime: Runtime) -> None:
    runs: list[int] = []

    def fit(request: PopulationRequest) -> bytes:
        runs.append(len(request.people))
        while len(ids) < 3:
            sleep(0.01)
        return fit_population(request)

    ids: list[str] = []
    trainer = PopulationTrainer(runtime.store, InlineEngine(), fit)
    runtime.populations = trainer
    finished = [finish(runtime, choices) for choices in ("abbaabababba", "babbaababaab", "aabbaabbaabb")]
    ids.extend(finished)
    learned_from(runtime.store, finished)
    trainer.close()
    assert len(runs) == 2
    assert runs[-1] == 3


def contents(url: str) -> bytes:
    """All bytes of the database's files."""
    return b"".join(path.read_bytes() for path in Path(url.removeprefix("sqlite:///")).parent.iterdir())


def test_deleting_a_person_takes_what_they_taught_out_of_everything(
    runtime: Runtime, database_url: str
) -> None:
    store = runtime.store
    first, second = finish(runtime), finish(runtime, "babbaababaab")
    taught = learned_from(store, [first, second])
    assert taught.population is not None
    third, fourth = begin(runtime), finish(runtime, "aabbaabbaabb")
    number = repr(float(taught.population.covariance[0, 0])).encode()
    learned_from(store, [first, second, fourth])
    assert number in contents(database_url)
    assert (len(store.posteriors(third)), len(store.posteriors(fourth))) == (1, 9)

    assert store.delete_session(first).n_shared_models == 1
    assert number not in contents(database_url)
    for session_id in (third, fourth):
        stored = adoption_of(store, session_id)
        assert stored is not None
        assert stored["population"] is None
    assert store.posteriors(third) == ()
    assert [record.query_index for record in store.posteriors(fourth)] == list(range(1, 9))
    assert store.shared_model(STUDY.name, KIND) is None
    assert len(store.events(fourth)) == 2 + 24
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as rows:
        assert rows.execute("SELECT count(*) FROM shared_model_people").fetchone() == (0,)

    # The live session, which still believes in them, goes on from the study file's prior; its answer counts.
    assert runtime.live(third).state.knowledge.population is not None
    answer(runtime, third, "ab")
    assert runtime.live(third).state.knowledge.population is None
    assert [record.query_index for record in store.posteriors(third)] == [1, 2]
    answer(runtime, third, "abababab" + "ab")
    found = learned_from(store, [second, third, fourth])
    assert first not in found.learned_from


def test_an_answer_after_a_deletion_is_followed_by_what_the_study_files_prior_asks(
    runtime: Runtime, database_url: str
) -> None:
    first = finish(runtime)
    learned_from(runtime.store, [first])
    second = begin(runtime, "the same streams")
    with open_store(database_url) as another_process:
        another_process.delete_session(first)
    answer(runtime, second, "a")
    followed = runtime.live(second)
    comparisons = followed.state.comparisons
    posterior = runtime.store.posteriors(second)[0]
    with wiring.headless() as apart:
        alone = services.join(apart, STUDY, "the same streams")[1].id
        expected = infer_posterior(apart.live(alone).study, "the same streams", 1, comparisons)
    np.testing.assert_array_equal(posterior.samples, expected.samples)


def test_somebody_deleted_while_they_are_learned_from_is_not_in_what_is_kept(runtime: Runtime) -> None:
    runtime.populations = None
    first, second = finish(runtime), finish(runtime, "babbaababaab")

    def fit(request: PopulationRequest) -> bytes:
        if first in request.people:
            runtime.store.delete_session(first)
        return fit_population(request)

    trainer = PopulationTrainer(runtime.store, InlineEngine(), fit)
    assert trainer.fit(STUDY) == 1
    found = adopted(runtime.store, STUDY)
    assert found is not None
    assert found.learned_from == (second,)
    trainer.close()


def test_somebody_deleted_while_the_next_one_begins_is_not_adopted(runtime: Runtime) -> None:
    first = finish(runtime)
    late = learned_from(runtime.store, [first])
    runtime.store.delete_session(first)
    offered = [late]

    def adopt(_: Runtime, study: Study) -> PopulationAdopted | None:
        return offered.pop() if offered else None

    record = services.join(runtime, STUDY, adopt=adopt)[1]
    assert [event.kind for event in runtime.store.events(record.id)] == ["session_begun", "query_prepared"]


@pytest.fixture
def exported(runtime: Runtime, tmp_path: Path) -> Path:
    """Two who started from the first one, of whom one has finished."""
    learned_from(runtime.store, [finish(runtime)])
    finish(runtime, "babbaababaab")
    learned_from(runtime.store, [record.id for record in runtime.store.sessions()])
    answer(runtime, begin(runtime), "abb")
    export(runtime.store, tmp_path / "out", ExportOptions("jsonl", "real", samples="all"))
    return tmp_path / "out"


def test_an_export_is_derived_again_from_what_each_person_started_from(exported: Path) -> None:
    assert [each.way for each in replayed(exported)] == ["derived"] * 3
    adopted = [
        [len(event.learned_from) for event in each.log if isinstance(event, PopulationAdopted)]
        for each in people_of(open_export(exported))
    ]
    assert adopted == [[], [1], [2]]
    assert [each.way for each in replayed(exported, by_steps=True)] == ["verified"] * 3


def test_another_number_of_the_people_before_makes_a_replay_fail(exported: Path) -> None:
    def change(log: list[Json]) -> None:
        changed = [row for row in log if row["kind"] == "population_adopted"][-1]
        changed["payload"]["population"]["mean"][1] += 20.0

    edit(exported, "events", change)
    mend(exported)
    last = rows(exported, "people")[-1]["person_id"]
    with pytest.raises(ReplayDifferenceError, match=rf"{last}: query 0 is not the one"):
        replayed(exported)


def test_queries_that_a_deleted_person_had_a_part_in_are_said_to_be_underivable(
    runtime: Runtime, exported: Path, tmp_path: Path
) -> None:
    first, second, _ = (record.id for record in runtime.store.sessions())
    runtime.store.delete_session(first)
    answer(runtime, begin(runtime), "ab")
    export(runtime.store, tmp_path / "after", ExportOptions("jsonl", "real", samples="all"))
    people = list(people_of(open_export(tmp_path / "after")))
    hindered = [each for each in people if each.hindrance]
    assert any(second in each.source for each in hindered)
    assert all("has been deleted" in each.hindrance for each in hindered)
    said = CliRunner().invoke(cli, ["replay", str(tmp_path / "after")])
    assert said.exit_code == 0
    assert (len(people), len(hindered)) == (3, 2)
    assert said.stdout.count("stored queries reproduced") == 1


def test_the_commands_learn_what_people_have_in_common(runtime: Runtime, database_url: str) -> None:
    runtime.populations = None
    first = finish(runtime)
    finish(runtime, "babbaababaab")
    database = ["--database", database_url]
    trained = [CliRunner().invoke(cli, ["train", *database, "--workers", "1"]).stdout for _ in range(2)]
    assert "Learned what 2 people of quickstart have in common." in trained[0]
    assert "in common" not in trained[1]
    said = CliRunner().invoke(cli, ["delete", first, "--yes", *database]).stdout
    assert "0 personal and 1 shared models" in said
    assert "Learned what 1 people of quickstart have in common." in said


def test_what_people_have_in_common_is_read_back_to_the_last_bit(runtime: Runtime) -> None:
    found = learned_from(runtime.store, [finish(runtime)])
    again = session_codec.from_json(
        "population_adopted", json.loads(json.dumps(session_codec.to_json(found)))
    )
    assert isinstance(again, PopulationAdopted)
    assert found.population is not None
    assert again.population is not None
    assert again.population.digest == found.population.digest
