"""A questionnaire's page says everything in the person's language and loses nothing that they have filled in."""

from __future__ import annotations

import asyncio
import re
from typing import Any
from urllib.parse import urlencode

import httpx
import pytest
from fastapi import FastAPI
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from app.settings import find_study
from app.web.forms import Fields, SentForm, number_in
from app.web.questionnaires import fields, what_to_mend
from study_core.path import Item
from study_core.questionnaire import Problem, check

URLENCODED = {"Content-Type": "application/x-www-form-urlencoded"}
QUESTIONNAIRES = find_study("full-path").file.questionnaire


def item(kind: str, **keys: Any) -> Item:
    made: Item = TypeAdapter(Item).validate_python({"kind": kind, "name": "it", "label": "What?", **keys})
    return made


def post(**content: Any) -> httpx.Response:
    """What a site answers that says what it has read from a form."""
    site = FastAPI()

    @site.post("/")
    def read(form: SentForm) -> Fields:
        return form

    async def send() -> httpx.Response:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(site), base_url="http://here") as browser:
            return await browser.post("/", **content)

    return asyncio.run(send())


@settings(max_examples=50)
@given(st.dictionaries(st.text(min_size=1), st.lists(st.text(), min_size=1, max_size=3), max_size=4))
def test_a_form_is_read_as_it_was_filled_in(form: Fields) -> None:
    typed = {name: [value.replace("\r\n", "\n") for value in values] for name, values in form.items()}
    assert post(content=urlencode(form, doseq=True), headers=URLENCODED).json() == typed


def test_the_end_of_a_line_is_one_character_again() -> None:
    assert post(content="it=one%0D%0Atwo", headers=URLENCODED).json() == {"it": ["one\ntwo"]}


@settings(max_examples=50)
@given(st.binary(max_size=200))
def test_a_form_of_any_bytes_is_read_or_refused(body: bytes) -> None:
    assert post(content=body, headers=URLENCODED).status_code in (200, 400)


def test_a_form_without_fields_is_empty() -> None:
    assert post(content=b"", headers=URLENCODED).json() == {}


def test_files_and_other_contents_are_refused() -> None:
    assert post(files={"it": b"content"}).status_code == 415
    assert post(json={"it": "a"}).status_code == 415


def test_a_form_of_thousands_of_fields_is_refused() -> None:
    assert post(content="a&" * 2000, headers=URLENCODED).status_code == 400


def test_a_number_of_ours_is_read_or_there_is_none() -> None:
    assert number_in({"step": ["12"]}, "step") == 12
    for values in ([], [""], ["1", "2"], ["-1"], ["1.0"], ["٢"], ["9" * 10]):
        assert number_in({"step": values}, "step") is None


@pytest.mark.parametrize(("language", "label"), [("en", "How old are you"), ("de", "Wie alt sind Sie")])
def test_a_page_asks_in_the_persons_language(language: str, label: str) -> None:
    age, gender, *_ = fields(QUESTIONNAIRES["demographics"], language)
    assert age.label.startswith(label)
    assert dict(gender.options)["woman"] == {"en": "Woman", "de": "Frau"}[language]
    mental, *_ = fields(QUESTIONNAIRES["nasa-tlx"], language)
    assert (mental.low, mental.high) == {"en": ("Low", "High"), "de": ("Gering", "Hoch")}[language]


def test_what_was_filled_in_is_shown_again_beside_what_has_to_be_mended() -> None:
    items = QUESTIONNAIRES["demographics"]
    form = {"age": ["about 40"], "gender": ["woman"], "country": ["<b>Sealand</b> "]}
    shown = {field.item.name: field for field in fields(items, "en", form, check(items, form).problems)}
    assert {name: field.filled_in for name, field in shown.items() if field.filled_in} == {
        name: tuple(values) for name, values in form.items()
    }
    assert {name for name, field in shown.items() if field.problem} == {"age"}


def test_a_page_that_is_opened_is_empty_and_finds_no_fault() -> None:
    for items in QUESTIONNAIRES.values():
        for field in fields(items, "de"):
            assert (field.filled_in, field.problem) == ((), None)


@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize("problem", Problem)
def test_every_problem_says_in_every_language_what_to_do(problem: Problem, language: str) -> None:
    asked = item("text") if problem is Problem.TOO_LONG else item("number", least=1000, most=1200)
    said = what_to_mend(asked, problem, language)
    assert re.match("Please .+[.]$" if language == "en" else "Bitte .+[.]$", said)


def test_limits_are_written_as_the_language_writes_numbers() -> None:
    asked = item("number", least=1000, most=1200)
    assert "1,000" in what_to_mend(asked, Problem.TOO_SMALL, "en")
    assert "1.200" in what_to_mend(asked, Problem.TOO_LARGE, "de")
    assert "5.000" in what_to_mend(item("text"), Problem.TOO_LONG, "de")
