"""Pages of a participant's path are taken once, with what was filled in, or name what has to be mended."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app import wiring
from app.services import path
from app.services import study as services
from app.services.runtime import Runtime
from app.settings import find_study
from study_core import session_codec
from study_core.events import StepOutcome, StepTaken
from study_core.path import Ending
from study_core.questionnaire import Problem

FULL_PATH = find_study("full-path")
YES = {path.ACCEPT: ["yes"]}
SEES = {"sees-animations": ["yes"]}
RIGHT = {"which-car": ["blue"], "right-answer": ["own"], "nearly-equal": ["closest"]}
WRONG = {**RIGHT, "which-car": ["orange"]}


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runtime]:
    """One for all: everybody has a session of their own."""
    with wiring.headless(f"sqlite:///{tmp_path_factory.mktemp('steps') / 'study.db'}") as opened:
        yield opened


@pytest.fixture
def person(runtime: Runtime) -> str:
    """The session of somebody who has just joined."""
    return services.join(runtime, FULL_PATH)[1].id


def steps_taken(runtime: Runtime, person: str) -> list[StepTaken]:
    """What the log holds of a person's steps, read anew."""
    read = [session_codec.from_json(record.kind, record.payload) for record in runtime.store.events(person)]
    return [event for event in read if isinstance(event, StepTaken)]


def take(runtime: Runtime, person: str, form: path.Form) -> path.StepReceipt:
    """Sends the current page."""
    n_tries = runtime.live(person).state.n_tries
    return path.take_step(runtime, person, services.screen(runtime, person).step, form, n_tries)


def practise(runtime: Runtime, person: str) -> None:
    """Goes from the first page to the comprehension check."""
    for form in (YES, SEES, {}):
        assert take(runtime, person, form).problems == {}
    while services.screen(runtime, person).kind == "question":
        services.answer(runtime, person, services.screen(runtime, person).query_index, "a", 900, confidence=3)


def finish_the_queries(runtime: Runtime, person: str) -> None:
    """Goes on to the first page after the queries."""
    practise(runtime, person)
    take(runtime, person, RIGHT)
    while (screen := services.screen(runtime, person)).kind != "step":
        if screen.kind == "break":
            path.end_break(runtime, person, screen.query_index)
        else:
            services.answer(runtime, person, screen.query_index, "a", 900, confidence=3)


def test_a_page_is_taken_with_what_was_read_and_answered(runtime: Runtime, person: str) -> None:
    take(runtime, person, YES)
    take(runtime, person, SEES)
    consent, screening = steps_taken(runtime, person)
    assert consent.content["read"] == {
        "study_hash": FULL_PATH.hash,
        "language": "en",
        "text_sha256": FULL_PATH.text_hash("consent", "en"),
    }
    assert screening.content["answers"] == {"sees-animations": "yes"}


def test_what_has_to_be_mended_is_named_and_nothing_is_recorded(runtime: Runtime, person: str) -> None:
    take(runtime, person, YES)
    receipt = take(runtime, person, {"sees-animations": ["perhaps"]})
    assert receipt.problems == {"sees-animations": Problem.UNKNOWN}
    assert (receipt.screen.kind, receipt.screen.step) == ("step", 1)
    assert len(steps_taken(runtime, person)) == 1


def test_declining_ends_the_session(runtime: Runtime, person: str) -> None:
    assert take(runtime, person, {path.ACCEPT: ["no"]}).screen.kind == "finished"
    assert runtime.live(person).state.ending is Ending.DECLINED


@pytest.mark.parametrize("form", [{}, {"accept": [""]}, {"accept": ["yes", "no"]}, {"consent": ["yes"]}])
def test_nobody_agrees_or_declines_by_saying_neither(runtime: Runtime, person: str, form: path.Form) -> None:
    receipt = take(runtime, person, form)
    assert receipt.problems == {path.ACCEPT: Problem.MISSING}
    assert (runtime.live(person).state.step, runtime.live(person).state.ending) == (0, None)


def test_an_answer_that_screens_out_ends_the_session(runtime: Runtime, person: str) -> None:
    take(runtime, person, YES)
    assert take(runtime, person, {"sees-animations": ["no"]}).screen.kind == "finished"
    assert runtime.live(person).state.ending is Ending.SCREENED_OUT


def test_the_comprehension_check_gives_a_second_chance(runtime: Runtime, person: str) -> None:
    practise(runtime, person)
    assert take(runtime, person, WRONG).screen.kind == "step"
    assert take(runtime, person, RIGHT).screen.kind == "question"
    outcomes = [event.outcome for event in steps_taken(runtime, person)[3:]]
    assert outcomes == [StepOutcome.AGAIN, StepOutcome.DONE]


def test_the_comprehension_check_gives_no_third_chance(runtime: Runtime, person: str) -> None:
    practise(runtime, person)
    take(runtime, person, WRONG)
    assert take(runtime, person, WRONG).screen.kind == "finished"
    assert runtime.live(person).state.ending is Ending.FAILED


def test_a_check_that_is_sent_twice_is_tried_once(runtime: Runtime, person: str) -> None:
    practise(runtime, person)
    step = services.screen(runtime, person).step
    for _ in range(3):
        assert path.take_step(runtime, person, step, WRONG, n_tries=0).screen.kind == "step"
    assert runtime.live(person).state.n_tries == 1


def test_a_missing_answer_is_no_try_of_the_check(runtime: Runtime, person: str) -> None:
    practise(runtime, person)
    for _ in range(3):
        assert set(take(runtime, person, {}).problems) == set(RIGHT)
    assert take(runtime, person, RIGHT).screen.kind == "question"


def test_a_page_that_is_sent_twice_is_taken_once(runtime: Runtime, person: str) -> None:
    for _ in range(3):
        screen = path.take_step(runtime, person, 0, YES).screen
    assert screen.step == 1
    assert len(steps_taken(runtime, person)) == 1
    # Nor can a page be sent that hasn't come yet.
    assert path.take_step(runtime, person, 2, {}).screen.step == 1


def test_free_text_is_in_the_log_as_it_was_typed(runtime: Runtime, person: str) -> None:
    finish_the_queries(runtime, person)
    load = {item.name: ["50"] for item in FULL_PATH.file.questionnaire["nasa-tlx"]}
    typed = " <script>alert('1')</script>\n\t„é“ \U0001f697 \x00 {questions} %s\n"
    for form in ({}, load, {"age": ["40"], "country": ["Sealand"]}, {"enjoyed": ["7"], "remarks": [typed]}):
        assert take(runtime, person, form).problems == {}
    answers = [event.content.get("answers") for event in steps_taken(runtime, person)]
    assert answers[-1] == {"enjoyed": 7, "cared-for": None, "remarks": typed}
    assert answers[-2]["country"] == "Sealand"
    assert answers[-2]["gender"] is None
    assert answers[-3] == dict.fromkeys(load, 50)
