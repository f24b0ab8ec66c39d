"""An export is derived again from itself alone, and a number in it that was changed is named."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app import wiring
from app.errors import AppError
from app.machine import machine
from app.services import path
from app.services import study as services
from app.services.export import ExportDifferenceError, ExportOptions, export, open_export
from app.services.rehearsal import Crowd, rehearse
from app.services.replay import OtherVersionError, ReplayDifferenceError, people_of
from app.services.runtime import Runtime
from app.services.walk import walk
from app.store import open_store
from study_core.comparison import Choice
from study_core.errors import ScriptError
from study_core.events import AnswerGiven
from study_core.path import Ending
from study_core.study import parse_study
from tests.services.export.people import FULL_PATH, QUICKSTART, let_everybody_in
from tests.support.exports import Json, edit, mend, replayed, rows, say_computed_elsewhere

SHORT = parse_study(
    QUICKSTART.text.replace("active_queries = 8 ", "active_queries = 4 ")
    .replace("test_queries = 4 ", "test_queries = 2 ")
    .replace("samples = 300 ", "samples = 100 ")
)


@pytest.fixture(scope="module")
def runtime() -> Iterator[Runtime]:
    """What computes; it keeps test sets from one test to the next."""
    with wiring.headless() as computing:
        yield computing


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "study.db"
    let_everybody_in(f"sqlite:///{path}")
    return path


def exported(database: Path, folder: Path, **options: Any) -> Path:
    with open_store(f"sqlite:///{database}") as store:
        export(
            store, folder, ExportOptions(**({"form": "jsonl", "people": "all", "samples": "all"} | options))
        )
    return folder


@pytest.fixture(scope="module")
def whole(database: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Everybody, with all samples."""
    return exported(database, tmp_path_factory.mktemp("whole") / "out")


@pytest.fixture(scope="module")
def small_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rehearsed person with a short session."""
    path = tmp_path_factory.mktemp("small") / "study.db"
    with wiring.headless(f"sqlite:///{path}") as computing:
        rehearse(computing, SHORT, Crowd(5, 1), 1, lambda: None)
    return path


@pytest.fixture(scope="module")
def small(small_database: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One person, with all samples."""
    return exported(small_database, tmp_path_factory.mktemp("small-export") / "out")


@pytest.fixture
def copy(small: Path, tmp_path: Path) -> Path:
    """The export of one person, to be changed."""
    return Path(shutil.copytree(small, tmp_path / "out"))


@pytest.mark.parametrize("by_steps", [False, True])
def test_everybody_is_reproduced(whole: Path, runtime: Runtime, by_steps: bool) -> None:
    people = replayed(whole, by_steps, runtime)
    assert {each.way for each in people} == {"verified" if by_steps else "derived"}
    finished = [each for each in people if each.n_queries >= 12]
    assert len(finished) >= 3
    assert not any(each.not_verified for each in people)


@pytest.mark.parametrize("samples", ["last", "none"])
def test_queries_are_derived_without_the_samples_and_steps_are_not_verified(
    small_database: Path, runtime: Runtime, tmp_path: Path, samples: str
) -> None:
    folder = exported(small_database, tmp_path / "out", samples=samples)
    assert {each.way for each in replayed(folder)} == {"derived"}
    with pytest.raises(ScriptError, match=r"expected the samples .* Export again with --samples all"):
        replayed(folder, True, runtime)


@pytest.mark.parametrize("form", ["csv", "parquet", "psych-ds"])
def test_every_form_is_replayed(small_database: Path, runtime: Runtime, tmp_path: Path, form: str) -> None:
    folder = exported(small_database, tmp_path / "out", form=form)
    (person,) = replayed(folder, runtime=runtime)
    assert (person.way, person.n_queries) == ("derived", 6)


def test_people_under_pseudonyms_are_replayed(database: Path, runtime: Runtime, tmp_path: Path) -> None:
    folder = exported(database, tmp_path / "out", key_file=tmp_path / "key.csv")
    assert len(replayed(folder, runtime=runtime)) == 5


def test_what_another_processor_computed_is_verified_step_by_step(
    database: Path, runtime: Runtime, tmp_path: Path
) -> None:
    elsewhere = Path(shutil.copy(database, tmp_path / "elsewhere.db"))
    say_computed_elsewhere(elsewhere)
    people = replayed(exported(elsewhere, tmp_path / "out"), runtime=runtime)
    assert {each.way for each in people} == {"verified"}
    assert {each.other_machines for each in people} == {("aarch64, another (cortex-a72): neon",)}


CONDITIONS = """
[[condition]]
name = "gain"

[[condition]]
name = "ties"
acquisition.method = "heuristic-relative"
response.answers = ["a", "b", "same"]
response.tie_threshold = 1.0
"""


@pytest.mark.parametrize("by_steps", [False, True])
def test_everybody_is_reproduced_in_their_condition_and_whoever_was_let_in_again(
    runtime: Runtime, tmp_path: Path, by_steps: bool
) -> None:
    study = parse_study(SHORT.text + CONDITIONS)
    with wiring.headless(f"sqlite:///{tmp_path / 'study.db'}") as computing:
        for number in (1, 2):
            rehearse(computing, study, Crowd(5, 2), number, lambda: None)
        _, record = services.join(computing, study.arms[0])
        services.answer(computing, record.id, 0, "a", 1234)
        path.end(computing, record.id, Ending.STOPPED)
        path.reopen(computing, record.id)
        walk(computing, record.id, lambda asked: AnswerGiven(asked.query_index, Choice.B, 900))
        export(computing.store, tmp_path / "out", ExportOptions("jsonl", "all", samples="all"))
    people = replayed(tmp_path / "out", by_steps, runtime)
    assert {each.study.condition for each in people} == {"gain", "ties"}
    assert [each.n_queries for each in people] == [6, 6, 6]


# A table, what is changed in it, and how the message names it. Times, costs and the like can't be derived.
def query(
    change: Callable[[Json], None], index: int = 3, kind: str = "query_prepared"
) -> Callable[[list[Json]], None]:
    def changed(log: list[Json]) -> None:
        change(
            next(
                row["payload"]
                for row in log
                if row["kind"] == kind and row["payload"]["query_index"] == index
            )
        )

    return changed


def flip(payload: Json) -> None:
    payload["choice"] = "b" if payload["choice"] == "a" else "a"


def add(key: str, by: float) -> Callable[[list[Json]], None]:
    def changed(table: list[Json]) -> None:
        row = next(each for each in table if each.get(key) is not None)
        row[key] += by

    return changed


def controls(payload: Json) -> None:
    payload["query"]["controls_b"][4] += 1e-12


def score(payload: Json) -> None:
    payload["provenance"]["score"] += 1e-15


CHANGES = {
    "a control": ("events", query(controls), "query 3 .*query.controls_b.4."),
    "a score": ("events", query(score), "query 3 .*provenance.score"),
    "a choice": (
        "events",
        query(flip, 1, "answer_given"),
        "query 2 is not the one that the answers before it lead to",
    ),
    "a control in the table": ("queries", add("controls_a_3", 1e-12), "table queries, query 0: controls_a_3"),
    "a response time": ("answers", add("response_time_ms", 1), "table answers, query 0: response_time_ms"),
    "a posterior mean": ("posteriors", add("mean_lane", 1e-15), "table posteriors, query 0: mean_"),
    "a diagnostic": ("posteriors", add("acceptance", 1e-15), "table posteriors, query 0: acceptance"),
    "a sample": ("samples", add("sample_lane", 1e-15), "table samples, query 0, sample 0: weight 0"),
    "a count": ("people", add("n_answers", 1), "table people, .*n_answers"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_number_is_named_by_the_digests_and_by_the_derivation_if_those_were_mended(
    copy: Path, runtime: Runtime, name: str
) -> None:
    table, change, named = CHANGES[name]
    edit(copy, table, change)
    with pytest.raises(ExportDifferenceError, match=rf"{table}\.jsonl, row \d+ \(person "):
        replayed(copy, runtime=runtime)
    mend(copy)
    with pytest.raises(ReplayDifferenceError, match=named) as caught:
        replayed(copy, runtime=runtime)
    person = rows(copy, "people")[0]["person_id"]
    assert person in str(caught.value)
    assert "\n" not in str(caught.value)


def test_both_values_of_a_difference_are_told(copy: Path, runtime: Runtime) -> None:
    stored = next(row for row in rows(copy, "queries") if row["query_index"] == 0)["score"]
    edit(copy, "events", query(lambda payload: payload["provenance"].update(score=0.5), 0))
    edit(copy, "queries", lambda table: table[0].update(score=0.5))
    mend(copy)
    with pytest.raises(ReplayDifferenceError, match=rf"stored 0\.5, derived {stored!r}"):
        replayed(copy, runtime=runtime)


NUMBERS = [
    *(
        ("queries", name)
        for name in ("controls_a_0", "controls_b_9", "features_a_lane", "weights_b_speed", "score")
    ),
    *(("answers", name) for name in ("response_time_ms", "query_index")),
    *(
        ("posteriors", name)
        for name in ("mean_speed", "r_hat_lane", "ess_bulk_heading", "n_draws", "rationality_q05")
    ),
    *(("samples", name) for name in ("sample_lane", "sample_collision")),
]


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 10**6), number=st.sampled_from(NUMBERS), is_mended=st.booleans())
def test_any_number_changed_in_any_row_makes_a_replay_fail(
    small: Path,
    runtime: Runtime,
    tmp_path_factory: pytest.TempPathFactory,
    place: int,
    number: tuple[str, str],
    is_mended: bool,
) -> None:
    table, column = number
    folder = Path(shutil.copytree(small, tmp_path_factory.mktemp("changed") / "out"))

    def change(known: list[Json]) -> None:
        having = [row for row in known if row[column] is not None]
        row = having[place % len(having)]
        row[column] = row[column] + 1 if isinstance(row[column], int) else row[column] * (1 + 2**-40) + 2**-60

    edit(folder, table, change)
    if is_mended:
        mend(folder)
    with pytest.raises(ReplayDifferenceError if is_mended else ExportDifferenceError, match=table):
        replayed(folder, runtime=runtime)
    shutil.rmtree(folder)


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The places of all numbers in a JSON value that aren't whole."""
    entries = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, entry in entries:
        yield from leaves(entry, (*path, key))
    if isinstance(value, float):
        yield path


@settings(max_examples=15)
@given(place=st.integers(0, 10**6), is_mended=st.booleans())
def test_any_number_of_any_query_changed_in_the_log_makes_a_replay_fail(
    small: Path, runtime: Runtime, tmp_path_factory: pytest.TempPathFactory, place: int, is_mended: bool
) -> None:
    folder = Path(shutil.copytree(small, tmp_path_factory.mktemp("changed") / "out"))

    def change(log: list[Json]) -> None:
        queries = [row["payload"] for row in log if row["kind"] == "query_prepared"]
        content = queries[place % len(queries)]
        del content["compute_ms"]
        (*path, last) = list(leaves(content))[place % len(list(leaves(content)))]
        for key in path:
            content = content[key]
        content[last] = content[last] * (1 + 2**-40) + 2**-60
        queries[place % len(queries)]["compute_ms"] = 1.0

    edit(folder, "events", change)
    if is_mended:
        mend(folder)
    named = r"query \d .*: stored " if is_mended else r"events\.jsonl, row \d+ \(person .* payload is"
    with pytest.raises(ReplayDifferenceError if is_mended else ExportDifferenceError, match=named):
        replayed(folder, runtime=runtime)
    shutil.rmtree(folder)


STEP_CHANGES = {
    "a control": lambda payload: payload["query"]["controls_b"].__setitem__(4, 0.1),
    "a feature": lambda payload: payload["query"]["features_a"].__setitem__(1, 0.1),
    "a score": lambda payload: payload["provenance"].update(score=0.5),
    "a weight": lambda payload: payload["provenance"]["weights_a"].__setitem__(0, 0.5),
}


@pytest.mark.parametrize("name", STEP_CHANGES)
def test_steps_find_a_change_that_tables_and_digests_were_mended_for(
    copy: Path, runtime: Runtime, name: str
) -> None:
    edit(copy, "events", query(STEP_CHANGES[name], 2))
    changed = next(
        row["payload"] for row in rows(copy, "events")
        if row["kind"] == "query_prepared" and row["payload"]["query_index"] == 2
    )  # fmt: skip

    def follow(table: list[Json]) -> None:
        row = next(each for each in table if each["query_index"] == 2)
        row["controls_b_4"] = changed["query"]["controls_b"][4]
        row["features_a_speed"] = changed["query"]["features_a"][1]
        row["score"] = changed["provenance"]["score"]
        row["weights_a_lane"] = changed["provenance"]["weights_a"][0]

    edit(copy, "queries", follow)
    mend(copy)
    with pytest.raises(ReplayDifferenceError, match=r"query 2: .*: stored .*, expected "):
        replayed(copy, True, runtime)


def test_a_log_that_cannot_have_come_about_is_named(copy: Path, runtime: Runtime) -> None:
    edit(copy, "events", query(lambda payload: payload.update(query_index=5), 3, "answer_given"))
    mend(copy)
    with pytest.raises(ReplayDifferenceError, match=r"person .*: this log can't have come about"):
        replayed(copy, runtime=runtime)


@pytest.mark.parametrize(
    ("place", "what"),
    [(0, "domain"), (1, "sampler"), (2, "optimiser"), (3, "acquisition method")],
)
def test_what_other_versions_computed_is_refused_with_the_release_to_install(
    copy: Path, runtime: Runtime, place: int, what: str
) -> None:
    def older(payload: Json) -> None:
        payload["provenance"]["versions"][place] = "older-0"
        payload["code_version"] = "0.0.7"

    edit(copy, "events", query(older))
    mend(copy)
    with pytest.raises(OtherVersionError, match=rf"query 3 .* {what} 'older-0'.* prefstudy==0\.0\.7"):
        replayed(copy, runtime=runtime)
    with pytest.raises(OtherVersionError, match="prefstudy==0"):
        replayed(copy, True, runtime)


def test_another_bank_is_refused_unless_steps_are_verified(copy: Path, runtime: Runtime) -> None:
    def other(log: list[Json]) -> None:
        for row in log:
            if row["kind"] == "query_prepared":
                row["payload"]["provenance"]["bank_digest"] = "ab" * 32

    edit(copy, "events", other)
    edit(copy, "queries", lambda table: [row.update(bank_digest="ab" * 32) for row in table])
    mend(copy)
    with pytest.raises(OtherVersionError, match=r"chosen from the bank abab.* --steps"):
        replayed(copy, runtime=runtime)
    people = replayed(copy, True, runtime)
    assert all(each.not_verified for each in people)


def test_a_session_of_before_sides_and_machines_were_kept_is_derived_again(
    copy: Path, runtime: Runtime
) -> None:
    new = ("first_shown", "repeat_of", "instructed", "machine")

    def older(log: list[Json]) -> None:
        for row in log:
            if row["kind"] == "query_prepared":
                row["payload"] = {key: value for key, value in row["payload"].items() if key not in new}
                # What the clips looked like when A always came first.
                row["payload"]["clips"] = dict.fromkeys(row["payload"]["clips"], "0" * 64)

    def undrawn(table: list[Json]) -> None:
        for row in table:
            row.update(dict.fromkeys(new), clips=dict.fromkeys(row["clips"], "0" * 64))

    edit(copy, "events", older)
    edit(copy, "queries", undrawn)
    edit(copy, "answers", lambda table: [row.update(position_chosen=None) for row in table])
    edit(copy, "people", lambda table: [row.update(n_sided=0, n_first=0) for row in table])
    mend(copy)
    (person,) = replayed(copy, runtime=runtime)
    assert (person.way, person.n_queries) == ("derived", 6)


def test_nobody_left_is_refused(tmp_path: Path) -> None:
    with wiring.headless(f"sqlite:///{tmp_path / 'empty.db'}") as runtime:
        services.join(runtime, FULL_PATH)
        export(runtime.store, tmp_path / "out", ExportOptions("jsonl"))
    with pytest.raises(ScriptError, match=r"found nobody\. .*was asked nothing"):
        replayed(tmp_path / "out")


def test_a_folder_that_is_no_export_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AppError, match="Name the folder that `prefstudy export` wrote"):
        replayed(tmp_path)


def test_a_person_says_on_what_their_queries_were_computed(whole: Path) -> None:
    asked = [person for person in people_of(open_export(whole)) if person.queries]
    assert {frozenset(person.machines) for person in asked} == {frozenset({machine()})}
