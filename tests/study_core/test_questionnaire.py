"""Answers to a questionnaire are taken as they were given, or refused for what is wrong with them."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from study_core.path import Item
from study_core.questionnaire import Problem, check, example_answer, is_right, screens_out

LABEL = {"name": "it", "label": "What?"}
ENDS = {"low": "low", "high": "high"}
ABC = [{"name": name, "label": name.upper()} for name in ("a", "b", "c")]


def item(kind: str, **keys: Any) -> Item:
    made: Item = TypeAdapter(Item).validate_python({**LABEL, "kind": kind, **keys})
    return made


AGE = item("number", least=18, most=120)
LENGTH = item("number", whole=False)
LOAD = item("scale", **ENDS)
FINE = item("scale", least=-1.0, most=1.0, step=0.1, **ENDS)
LIKERT = item("likert", points=5, **ENDS)
ONE = item("choice", options=ABC)
SOME = item("choice", options=ABC, several=True)
TEXT = item("text", longest=20)
EVERY_KIND = (AGE, LENGTH, LOAD, FINE, LIKERT, ONE, SOME, TEXT)


def answer(asked: Item, *sent: str) -> object:
    """The value of an answer, or what is wrong with it."""
    checked = check([asked], {"it": sent})
    assert len(checked.values) + len(checked.problems) == 1
    return {**checked.values, **checked.problems}["it"]


@pytest.mark.parametrize(
    ("asked", "sent", "value"),
    [
        (AGE, "42", 42),
        (AGE, " 42 ", 42),
        (AGE, "٤٢", 42),  # Arabic digits
        (AGE, "17", Problem.TOO_SMALL),
        (AGE, "121", Problem.TOO_LARGE),
        (AGE, "42.5", Problem.NOT_WHOLE),
        (AGE, "1.000", Problem.NOT_WHOLE),
        (AGE, "forty", Problem.NOT_A_NUMBER),
        (AGE, "4_2", Problem.NOT_A_NUMBER),
        (AGE, "1e2", Problem.NOT_A_NUMBER),
        (AGE, "nan", Problem.NOT_A_NUMBER),
        (AGE, "9" * 5000, Problem.NOT_A_NUMBER),
        (LENGTH, "1.75", 1.75),
        (LENGTH, "1,75", 1.75),
        (LENGTH, "-3", -3),
        (LENGTH, "−3", -3),
        (LENGTH, "inf", Problem.NOT_A_NUMBER),
        (LENGTH, "1.234,5", Problem.NOT_A_NUMBER),
        (LOAD, "0", 0),
        (LOAD, "100", 100),
        (LOAD, "42", Problem.UNKNOWN),
        (LOAD, "105", Problem.UNKNOWN),
        (LOAD, "high", Problem.UNKNOWN),
        (FINE, "0.3", 0.3),
        (FINE, "-0.7", -0.7),
        (FINE, "0.35", Problem.UNKNOWN),
        (LIKERT, "5", 5),
        (LIKERT, "0", Problem.UNKNOWN),
        (LIKERT, "6", Problem.UNKNOWN),
        (LIKERT, "2.5", Problem.UNKNOWN),
        (ONE, "b", "b"),
        (ONE, "d", Problem.UNKNOWN),
        (SOME, "b", ["b"]),
        (TEXT, "x" * 20, "x" * 20),
        (TEXT, "x" * 21, Problem.TOO_LONG),
    ],
)
def test_an_answer_is_taken_or_refused_for_what_is_wrong_with_it(
    asked: Item, sent: str, value: object
) -> None:
    given_value = answer(asked, sent)
    assert given_value == value
    assert type(given_value) is type(value)


def test_one_option_is_one_and_several_come_in_the_order_of_the_question() -> None:
    assert answer(ONE, "a", "b") == Problem.UNKNOWN
    assert answer(SOME, "c", "a", "c") == ["a", "c"]
    assert answer(SOME, "c", "d") == Problem.UNKNOWN


@pytest.mark.parametrize("asked", EVERY_KIND, ids=lambda asked: asked.kind)
@pytest.mark.parametrize("sent", [(), ("",), ("  ",)])
def test_what_must_be_answered_is_missed(asked: Item, sent: tuple[str, ...]) -> None:
    assert answer(asked, *sent) == Problem.MISSING


@pytest.mark.parametrize("asked", EVERY_KIND, ids=lambda asked: asked.kind)
def test_what_need_not_be_answered_may_be_left_out(asked: Item) -> None:
    assert answer(asked.model_copy(update={"required": False}), "") is None
    assert answer(asked.model_copy(update={"required": False})) is None


@given(st.text(max_size=5000))
def test_any_text_comes_back_as_it_was_typed(typed: str) -> None:
    assert answer(item("text", required=False), typed) == (typed or None)


@given(
    st.dictionaries(st.text(max_size=3), st.lists(st.text(max_size=20), max_size=4), max_size=4), st.data()
)
def test_any_form_at_all_is_checked_whole(form: dict[str, list[str]], data: st.DataObject) -> None:
    items = [each.model_copy(update={"name": f"item-{k}"}) for k, each in enumerate(EVERY_KIND)]
    for each in items:
        form[each.name] = data.draw(
            st.lists(st.text(alphabet="0123456789.,-+eabc \n_", max_size=6), max_size=3)
        )
    checked = check(items, form)
    assert set(checked.values) | set(checked.problems) == {each.name for each in items}
    assert not set(checked.values) & set(checked.problems)
    # Neither fails on what is left of a form that must be mended.
    assert is_right(items, checked.values)
    assert not screens_out(items, checked.values)


def test_a_check_is_passed_with_every_right_answer() -> None:
    one = item("choice", options=ABC, right="b")
    number = item("number", right=3.0).model_copy(update={"name": "number"})
    free = TEXT.model_copy(update={"name": "free"})
    items = (one, number, free)
    assert is_right(items, check(items, {"it": ["b"], "number": ["3"], "free": ["x"]}).values)
    assert not is_right(items, check(items, {"it": ["a"], "number": ["3"], "free": ["x"]}).values)
    assert not is_right(items, check(items, {"it": ["b"], "number": ["4"], "free": ["x"]}).values)


def test_of_several_options_the_right_one_alone_is_right() -> None:
    asked = item("choice", options=ABC, several=True, right="b")
    assert is_right([asked], {"it": ["b"]})
    assert not is_right([asked], {"it": ["a", "b"]})


def test_answers_that_screen_out_do() -> None:
    one = item("choice", options=ABC, screens_out=["c"])
    some = item("choice", options=ABC, several=True, screens_out=["b", "c"])
    number = item("number", screens_out=[0.0])
    for asked, sent, ends in (
        (one, ["c"], True),
        (one, ["a"], False),
        (some, ["a", "b"], True),
        (some, ["a"], False),
        (number, ["0"], True),
        (number, ["1"], False),
    ):
        assert screens_out([asked], check([asked], {"it": sent}).values) is ends


def test_what_is_left_out_screens_nobody_out() -> None:
    asked = item("choice", options=ABC, screens_out=["c"], required=False)
    assert not screens_out([asked], check([asked], {}).values)


@pytest.mark.parametrize(
    "asked",
    [
        *EVERY_KIND,
        item("choice", options=ABC, screens_out=["a", "b"]),
        item("choice", options=ABC, right="c"),
        item("number", right=3.0),
        item("number", screens_out=[0.0, 1.0]),
        item("number", least=0.5, screens_out=[1.0]),
        item("number", most=-7.0),
        item("number", least=0.1, most=0.9, whole=False),
    ],
)
def test_an_example_of_an_answer_is_right_and_ends_nothing(asked: Item) -> None:
    checked = check([asked], {"it": [example_answer(asked)]})
    assert checked.problems == {}
    assert is_right([asked], checked.values)
    assert not screens_out([asked], checked.values)
