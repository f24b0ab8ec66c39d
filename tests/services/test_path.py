"""A whole path through the real services, headless: nothing is doubled, and what is taken back leaves no trace."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from app import wiring
from app.services import path, shown
from app.services import study as services
from app.services.export import ExportOptions, export, open_export
from app.services.rehearsal import rehearse
from app.services.rehearsed_person import Crowd
from app.services.replay import people_of
from app.services.runtime import Runtime
from app.services.study import InvalidAnswerError, Outcome, Screen
from app.services.walk import walk
from app.settings import find_study
from study_core import session_codec
from study_core.comparison import Choice
from study_core.events import AnswerGiven, QueryPrepared
from study_core.participants import Habits
from study_core.path import Ending
from study_core.plan import Phase, Position, position_of
from study_core.study import Study, parse_study
from tests.support.exports import replayed

STUDY = find_study("full-path")
KINDS = [step.step for step in STUDY.file.path]
PRACTICE, N_PRACTICE = KINDS.index("practice"), 2
NASA, DEMOGRAPHICS, CLOSING = (
    i for i in range(KINDS.index("queries"), len(KINDS)) if KINDS[i] == "questionnaire"
)

YES, NO = {path.ACCEPT: ["yes"]}, {path.ACCEPT: ["no"]}
SEES = {"sees-animations": ["yes"]}
UNDERSTOOD = {item.name: [item.right] for item in STUDY.file.questionnaire["comprehension"]}
CONFUSED = {name: ["no-such-option"] for name in UNDERSTOOD}
MISTAKEN = {
    item.name: [next(option.name for option in item.options if option.name != item.right)]
    for item in STUDY.file.questionnaire["comprehension"]
}
LOAD = {item.name: ["35"] for item in STUDY.file.questionnaire["nasa-tlx"]}
FORMS = [
    YES,
    SEES,
    {},
    UNDERSTOOD,
    {},
    {},
    LOAD,
    {},
    {"enjoyed": ["6"], "remarks": ["<b>Thanks</b> & bye"]},
    {},
]


@pytest.fixture
def runtime(database_url: str) -> Iterator[Runtime]:
    with wiring.headless(database_url) as opened:
        yield opened


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Runtime, str]]:
    """Somebody who has walked the whole path, and liked A better at each query."""
    with wiring.headless(f"sqlite:///{tmp_path_factory.mktemp('path') / 'study.db'}") as opened:
        session_id = join(opened)
        go_to(opened, session_id, lambda screen: screen.kind == "finished")
        yield opened, session_id


def join(runtime: Runtime, study: Study = STUDY, person: str = "somebody") -> str:
    return services.join(runtime, study, rehearsal=person)[1].id


def answered(runtime: Runtime, session_id: str, choice: str) -> Screen:
    """Answers whatever is asked, by identity."""
    screen = services.screen(runtime, session_id)
    assert screen.query_index is not None
    confidence = 3 if choice in "ab" else None
    receipt = services.answer(runtime, session_id, screen.query_index, choice, 1000, confidence=confidence)
    assert receipt.outcome is Outcome.TAKEN
    return receipt.screen


def go_on(runtime: Runtime, session_id: str, choice: str = "a") -> Screen:
    """Does what comes next."""
    screen = services.screen(runtime, session_id)
    if screen.kind == "step":
        receipt = path.take_step(runtime, session_id, screen.step, FORMS[screen.step])
        assert not receipt.problems
        return receipt.screen
    if screen.kind == "break":
        assert screen.query_index is not None
        return path.end_break(runtime, session_id, screen.query_index)
    return answered(runtime, session_id, choice)


def go_to(runtime: Runtime, session_id: str, is_there: Callable[[Screen], bool]) -> Screen:
    screen = services.screen(runtime, session_id)
    while not is_there(screen):
        screen = go_on(runtime, session_id)
    return screen


def kinds(runtime: Runtime, session_id: str) -> list[str]:
    return [event.kind for event in runtime.store.events(session_id)]


def queries(runtime: Runtime, session_id: str) -> list[str]:
    """Every query that stands, all of its bits."""
    prepared = runtime.live(session_id).state.prepared
    plain = (session_codec.to_json(query) for query in prepared)
    return [json.dumps({**query, "compute_ms": None}, sort_keys=True) for query in plain]


def test_a_whole_path_is_walked_step_by_step_to_its_end(runtime: Runtime) -> None:
    session_id = join(runtime)
    seen = []
    screen = services.screen(runtime, session_id)
    while screen.kind != "finished":
        seen.append((screen.kind, screen.step))
        screen = go_on(runtime, session_id)
    questions = [("question", step) for step in (PRACTICE, PRACTICE + 1)]
    asked = STUDY.n_queries - N_PRACTICE
    assert seen[:6] == [("step", 0), ("step", 1), ("step", 2), questions[0], questions[0], ("step", PRACTICE)]
    assert seen[-5:] == [("step", step) for step in range(PRACTICE + 2, len(KINDS))]
    assert seen[6:-5].count(questions[1]) == asked
    breaks = [i for i, each in enumerate(seen[6:-5]) if each[0] == "break"]
    # After every four, but not after the last.
    assert breaks == [4, 9]
    state = runtime.live(session_id).state
    assert (state.ending, len(state.answers)) == (Ending.COMPLETED, STUDY.n_queries)
    said = {event.step: event.content.get("answers") for event in state.taken}
    assert said[NASA] == dict.fromkeys(LOAD, 35)
    assert said[CLOSING] == {"enjoyed": 6, "cared-for": None, "remarks": "<b>Thanks</b> & bye"}
    assert all(value in (None, []) for value in said[DEMOGRAPHICS].values())
    assert [answer.confidence for answer in state.answers] == [3] * STUDY.n_queries


def test_each_step_says_what_exactly_was_read_and_in_which_language(runtime: Runtime) -> None:
    session_id = join(runtime)
    path.take_step(runtime, session_id, 0, YES)
    assert path.choose_language(runtime, session_id, "de").kind == "step"
    path.take_step(runtime, session_id, 1, SEES)
    path.take_step(runtime, session_id, 2, {})
    first, second, third = (event.content["read"] for event in runtime.live(session_id).state.taken)
    assert [read["language"] for read in (first, second, third)] == ["en", "de", "de"]
    assert {read["study_hash"] for read in (first, second, third)} == {STUDY.hash}
    assert first["text_sha256"] == STUDY.text_hash("consent", "en")
    assert (
        third["text_sha256"] == STUDY.text_hash("instructions", "de") != STUDY.text_hash("instructions", "en")
    )
    assert "text_sha256" not in second
    path.choose_language(runtime, session_id, "de")
    path.choose_language(runtime, session_id, "xx")
    assert kinds(runtime, session_id).count("language_chosen") == 1


def test_practice_repeats_and_checks_teach_nothing(finished: tuple[Runtime, str]) -> None:
    runtime, session_id = finished
    state = runtime.live(session_id).state
    phases = [query.phase for query in state.prepared]
    assert [phases.count(phase) for phase in Phase] == [2, 6, 2, 1, 3]
    active = [query.proposed.query for query in state.prepared if query.phase is Phase.ACTIVE]
    expected = [query.features_a - query.features_b for query in active]
    np.testing.assert_array_equal(state.comparisons.feature_diffs, expected)
    # One posterior before each active query, and one after the last answer to one.
    inferred = [posterior.query_index for posterior in runtime.store.posteriors(session_id)]
    places = [i for i, phase in enumerate(phases) if phase is Phase.ACTIVE]
    assert inferred == [*places, phases.index(Phase.TEST)]


def test_a_repeat_is_the_same_query_to_the_last_bit_with_its_sides_swapped(
    finished: tuple[Runtime, str],
) -> None:
    runtime, session_id = finished
    prepared = runtime.live(session_id).state.prepared
    repeats = [query for query in prepared if query.repeat_of is not None]
    assert len(repeats) == 2
    for again in repeats:
        assert again.repeat_of is not None
        first = prepared[again.repeat_of]
        assert session_codec.proposed_to_json(again.proposed) == session_codec.proposed_to_json(
            first.proposed
        )
        assert {again.first_shown, first.first_shown} == {Choice.A, Choice.B}
        assert again.clips.keys() == first.clips.keys()
        assert set(again.clips.values()).isdisjoint(first.clips.values())


def test_practice_and_checks_are_the_same_for_everyone_and_none_is_of_the_test_set(
    finished: tuple[Runtime, str],
) -> None:
    runtime, session_id = finished
    people = [session_id, join(runtime, person="another")]
    while services.screen(runtime, people[1]).kind != "finished":
        go_on(runtime, people[1], "b")
    drives = []
    for session_id in people:
        common: dict[Phase, list[bytes]] = {}
        for query in runtime.live(session_id).state.prepared:
            common.setdefault(query.phase, []).append(query.proposed.query.controls_a.tobytes())
        drives.append(common)
    for phase in (Phase.PRACTICE, Phase.CHECK, Phase.TEST):
        assert drives[0][phase] == drives[1][phase]
    assert drives[0][Phase.ACTIVE] != drives[1][Phase.ACTIVE]
    shared = [each for phase in (Phase.PRACTICE, Phase.CHECK, Phase.TEST) for each in drives[0][phase]]
    assert len(set(shared)) == len(shared)


def asks(query_index: int) -> Callable[[Screen], bool]:
    return lambda screen: screen.kind == "question" and screen.query_index == query_index


@pytest.mark.parametrize("query_index", [0, N_PRACTICE + 2, N_PRACTICE + 3])
def test_an_answer_taken_back_and_given_otherwise_leads_where_that_answer_would_have_led(
    runtime: Runtime, query_index: int
) -> None:
    doubtful, sure = join(runtime), join(runtime)
    for session_id in (doubtful, sure):
        go_to(runtime, session_id, asks(query_index))
    after = answered(runtime, doubtful, "a")
    assert after.can_take_back
    if after.kind == "break":
        path.end_break(runtime, doubtful, query_index + 1)
    back = path.take_back(runtime, doubtful, query_index)
    assert (back.kind, back.query_index, back.can_take_back) == ("question", query_index, False)
    # It's the last answer that can be taken back, and that once.
    assert path.take_back(runtime, doubtful, query_index).position == back.position
    assert path.take_back(runtime, doubtful, query_index - 1).position == back.position
    for session_id in (doubtful, sure):
        answered(runtime, session_id, "b")
        go_to(runtime, session_id, asks(query_index + 3))
    assert queries(runtime, doubtful) == queries(runtime, sure)
    for one, other in zip(runtime.store.posteriors(doubtful), runtime.store.posteriors(sure), strict=True):
        assert one.query_index == other.query_index
        np.testing.assert_array_equal(one.samples, other.samples)
    # The log keeps both.
    events = runtime.store.events(doubtful)
    given = [
        event
        for event in events
        if event.kind == "answer_given" and event.payload["query_index"] == query_index
    ]
    assert [event.payload["choice"] for event in given] == ["a", "b"]


def test_the_last_answer_before_a_step_stays(runtime: Runtime) -> None:
    session_id = join(runtime)
    screen = go_to(runtime, session_id, lambda screen: screen.kind == "step" and screen.step == PRACTICE)
    assert not screen.can_take_back
    assert path.take_back(runtime, session_id, N_PRACTICE - 1).position == screen.position
    assert "answer_taken_back" not in kinds(runtime, session_id)


def test_stopping_keeps_the_answers_and_asks_nothing_more(runtime: Runtime) -> None:
    session_id = join(runtime)
    go_to(runtime, session_id, asks(4))
    assert path.end(runtime, session_id, Ending.STOPPED).kind == "finished"
    assert path.end(runtime, session_id, Ending.TIMED_OUT).kind == "finished"
    live = runtime.live(session_id)
    assert (live.state.ending, len(live.state.answers), live.ahead) == (Ending.STOPPED, 4, {})
    assert shown.shown(runtime, session_id) is None
    assert services.screen(runtime, session_id).kind == "finished"
    assert services.answer(runtime, session_id, 4, "a", 900, confidence=1).outcome is Outcome.NOT_CURRENT


def test_many_presses_of_every_button_do_each_thing_once(runtime: Runtime) -> None:
    session_id = join(runtime)
    with ThreadPoolExecutor(8) as pool:
        while (screen := services.screen(runtime, session_id)).kind != "finished":
            if screen.kind == "step":
                presses = [lambda s=screen: path.take_step(runtime, session_id, s.step, FORMS[s.step])] * 8
            elif screen.kind == "break":
                presses = [lambda s=screen: path.end_break(runtime, session_id, s.query_index)] * 8
            else:
                presses = [
                    lambda s=screen: services.answer(runtime, session_id, s.query_index, "a", 5, confidence=2)
                ] * 8
            list(pool.map(lambda press: press(), presses))
    events = kinds(runtime, session_id)
    assert events.count("answer_given") == events.count("query_prepared") == STUDY.n_queries
    assert (events.count("step_taken"), events.count("break_taken")) == (len(KINDS) - 1, 2)


def test_two_processes_that_do_the_same_do_it_once(database_url: str) -> None:
    with wiring.headless(database_url) as one, wiring.headless(database_url) as two:
        session_id = join(one)
        while services.screen(two, session_id).kind != "finished":
            before = services.screen(two, session_id)
            go_on(one, session_id)
            # The second still believes in the screen that it has read.
            if before.kind == "step":
                path.take_step(two, session_id, before.step, FORMS[before.step])
            elif before.kind == "break":
                assert before.query_index is not None
                path.end_break(two, session_id, before.query_index)
            else:
                assert before.query_index is not None
                late = services.answer(two, session_id, before.query_index, "b", 9, confidence=1)
                assert late.outcome is Outcome.ALREADY_TAKEN
        events = kinds(one, session_id)
        assert events.count("answer_given") == STUDY.n_queries
        assert events.count("step_taken") == len(KINDS) - 1
        assert {given.choice for given in two.live(session_id).state.answers} == {Choice.A}


@pytest.mark.slow
def test_a_restart_between_any_two_things_changes_nothing(
    database_url: str, finished: tuple[Runtime, str]
) -> None:
    undisturbed, its_session = finished
    kind = "joined"
    while kind != "finished":
        with wiring.headless(database_url) as restarted:
            session_id = join(restarted) if kind == "joined" else restarted.store.sessions()[0].id
            before = services.screen(restarted, session_id)
        with wiring.headless(database_url) as restarted:
            assert services.screen(restarted, session_id) == before
            kind = before.kind if before.kind == "finished" else go_on(restarted, session_id).kind
    with wiring.headless(database_url) as restarted:
        assert queries(restarted, session_id) == queries(undisturbed, its_session)
        assert kinds(restarted, session_id) == kinds(undisturbed, its_session)


def test_positions_on_the_page_are_trajectories_in_the_log(runtime: Runtime) -> None:
    session_id = join(runtime)
    for pressed in ("first", "second", "second", "first", "same", "skip"):
        screen = go_to(runtime, session_id, lambda screen: screen.kind == "question")
        assert screen.query_index is not None
        choice = services.choice_behind(runtime, session_id, screen.query_index, pressed)
        confidence = None if choice == "skip" else 1
        services.answer(runtime, session_id, screen.query_index, choice, 900, confidence=confidence)
        state = runtime.live(session_id).state
        query, given = state.prepared[screen.query_index], state.answers[-1]
        expected = Position(pressed) if pressed in set(Position) else None
        assert position_of(query.first_shown, given.choice) is expected
        assert expected is not None or given.choice == pressed
    for wrong in ("a", "b"):
        with pytest.raises(InvalidAnswerError, match="position"):
            services.choice_behind(runtime, session_id, 0, wrong)
    for index in (-1, STUDY.n_queries, 13):
        nobodys = services.choice_behind(runtime, session_id, index, "first")
        assert (
            services.answer(runtime, session_id, index, nobodys, 9, confidence=1).outcome
            is Outcome.NOT_CURRENT
        )


def test_a_session_of_a_version_that_drew_no_sides_goes_on_with_a_first(runtime: Runtime) -> None:
    study = find_study("quickstart")
    _, record = services.join(runtime, study)
    live = runtime.live(record.id)
    answered_by_position = []
    for index in range(6):
        current = live.state.prepared[index]
        content = session_codec.to_json(current)
        for key in ("first_shown", "repeat_of", "instructed"):
            del content[key]
        read = session_codec.from_json("query_prepared", content)
        assert isinstance(read, QueryPrepared)
        assert read.first_shown is None
        assert read.side_shown_first is Choice.A
        answered_by_position.append(services.choice_behind(runtime, record.id, index, "first"))
        services.answer(runtime, record.id, index, "a", 900)
    sides = [query.first_shown for query in live.state.prepared[:6]]
    assert answered_by_position == sides
    assert set(sides) == {Choice.A, Choice.B}


def test_the_stage_shows_the_example_with_the_instructions_and_then_each_query(runtime: Runtime) -> None:
    session_id = join(runtime)
    assert shown.shown(runtime, session_id) is None
    go_to(runtime, session_id, lambda screen: screen.kind == "step" and screen.step == 2)
    example = shown.shown(runtime, session_id)
    assert example is not None
    assert example.key == "example"
    go_to(runtime, session_id, asks(0))
    first = shown.shown(runtime, session_id)
    assert first is not None
    query = runtime.live(session_id).state.prepared[0]
    assert (first.query is query.proposed.query, first.first_shown) == (True, query.first_shown)
    assert first.query.controls_a.tobytes() != example.query.controls_a.tobytes()


def test_simulated_people_walk_the_whole_path_and_do_as_checks_say(runtime: Runtime) -> None:
    # Somebody who always chooses the second position, unless told otherwise.
    rehearsal = rehearse(
        runtime, STUDY, Crowd(3, 1, Habits(side_bias=-1000.0), lapse_rate=0.0), 1, lambda: None
    )
    (record,) = runtime.store.sessions()
    state = runtime.live(record.id).state
    assert state.ending is Ending.COMPLETED
    assert len(rehearsal.rows) == STUDY.n_queries
    for row, query, given in zip(rehearsal.rows, state.prepared, state.answers, strict=True):
        position = position_of(query.first_shown, given.choice)
        assert position is (query.instructed or Position.SECOND)
        assert (row["choice"], row["phase"]) == (given.choice.value, query.phase.value)
        assert row["probability"] == pytest.approx(1.0)
    assert {given.choice for given in state.answers} == {Choice.A, Choice.B}


def exported(runtime: Runtime, folder: Path) -> Path:
    export(runtime.store, folder, ExportOptions("jsonl", "all", samples="all"))
    return folder


def test_sessions_with_everything_that_happens_on_the_way_can_be_derived_again(
    runtime: Runtime, tmp_path: Path
) -> None:
    # With breaks, steps and answers taken back, to the end.
    whole = join(runtime, person="whole")
    go_to(runtime, whole, asks(N_PRACTICE + 3))
    answered(runtime, whole, "a")
    path.take_back(runtime, whole, N_PRACTICE + 3)
    answered(runtime, whole, "skip")
    go_to(runtime, whole, lambda screen: screen.kind == "finished")
    # Stopped in the middle, just after an answer was taken back, or in practice.
    for place, person in ((N_PRACTICE + 2, "middle"), (1, "practice")):
        session_id = join(runtime, person=person)
        go_to(runtime, session_id, asks(place))
        answered(runtime, session_id, "b")
        path.take_back(runtime, session_id, place)
        path.end(runtime, session_id, Ending.STOPPED)
    people = replayed(exported(runtime, tmp_path / "out"))
    # Queries that had been prepared after an answer that was taken back are derived as well.
    assert [person.n_queries > person.study.n_queries for person in people] == [True, False, False]
    assert {person.way for person in people} == {"derived"}
    assert {person.way for person in replayed(tmp_path / "out", by_steps=True)} == {"verified"}


def test_who_was_asked_nothing_is_named_and_left_out_of_a_replay(runtime: Runtime, tmp_path: Path) -> None:
    declined = join(runtime, person="declined")
    path.take_step(runtime, declined, 0, NO)
    join(runtime, person="reads the consent form")
    people = list(people_of(open_export(exported(runtime, tmp_path / "out"))))
    assert len(people) == 2
    for person in people:
        assert "was asked nothing" in person.hindrance


def test_walking_takes_whatever_page_comes(runtime: Runtime) -> None:
    text = STUDY.text.replace('check = "comprehension"\n', "").replace(
        "confidence = true", "confidence = false"
    )
    study = parse_study(text)
    session_id = join(runtime, study)
    walk(runtime, session_id, lambda query: AnswerGiven(query.query_index, Choice.B, 700))
    assert runtime.live(session_id).state.ending is Ending.COMPLETED
