"""The texts, questionnaires and the showcase study that ship are whole, in every language alike."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest
from pydantic import TypeAdapter

from app.settings import STATIC, find_study
from app.web.markdown import render_markdown
from study_core.path import ChoiceItem, Ending, Item, ScaleItem, Step
from tests.web.test_markdown import Reader

LANGUAGES = ("en", "de")
TEXTS = STATIC / "texts"
NAMES = {
    *("consent", "instructions", "practice", "break", "debrief", "thanks"),
    *("declined", "screened-out", "failed", "stopped", "deleted", "timed-out"),
}
QUESTIONNAIRES = sorted((STATIC / "questionnaires").glob("*.toml"))
FULL_PATH = find_study("full-path").file


def text(name: str, language: str) -> str:
    return (TEXTS / f"{name}.{language}.md").read_text(encoding="utf-8")


def items(path: Path) -> tuple[Item, ...]:
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert set(content) == {"item"}
    return TypeAdapter(tuple[Item, ...]).validate_python(tuple(content["item"]))


def words(value: object) -> Iterator[dict[str, str]]:
    """Everything that is said by language, anywhere in what TOML holds."""
    if isinstance(value, dict):
        if "en" in value or "de" in value:
            yield value
        else:
            yield from (each for part in value.values() for each in words(part))
    elif isinstance(value, list):
        yield from (each for part in value for each in words(part))


def questionnaire(name: str) -> tuple[Item, ...]:
    return items(STATIC / "questionnaires" / f"{name}.toml")


def test_every_ready_text_is_there_in_every_language() -> None:
    assert {path.name for path in TEXTS.iterdir()} == {
        f"{name}.{language}.md" for name in NAMES for language in LANGUAGES
    }


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_text_is_built_alike_in_every_language(name: str) -> None:
    shapes = set()
    for language in LANGUAGES:
        assert text(name, language).strip()
        tags = [tag for tag, _ in Reader(render_markdown(text(name, language))).elements]
        shapes.add((tuple(tags), tuple(re.findall(r"\{\w+\}", text(name, language)))))
    assert len(shapes) == 1


def test_texts_name_only_what_the_pages_fill_in() -> None:
    named = {name for path in TEXTS.iterdir() for name in re.findall(r"\{(.*?)\}", path.read_text())}
    assert named == {"questions", "duration"}


def test_ready_texts_use_the_quotation_marks_and_apostrophes_of_print() -> None:
    said = [path.read_text(encoding="utf-8") for path in TEXTS.iterdir()]
    for path in (*QUESTIONNAIRES, STATIC / "studies" / "full-path.toml"):
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        said += [version for each in words(content) for version in each.values()]
    assert [each for each in said if re.search(r"[\"']|\.\.\.| - ", each)] == []


@pytest.mark.parametrize("path", QUESTIONNAIRES, ids=lambda path: path.stem)
def test_a_questionnaire_can_be_read_in_every_language(path: Path) -> None:
    assert items(path)
    for each in words(tomllib.loads(path.read_text(encoding="utf-8"))):
        assert tuple(each) == LANGUAGES
        assert all(version.strip() for version in each.values())
        assert each["en"] != each["de"] or each["en"] == "Frustration"


def test_nobody_has_to_tell_who_they_are() -> None:
    assert not any(item.required for item in questionnaire("demographics"))


def test_the_task_load_index_has_six_scales_of_21_positions() -> None:
    scales = questionnaire("nasa-tlx")
    names = ["mental-demand", "physical-demand", "temporal-demand", "performance", "effort", "frustration"]
    assert [scale.name for scale in scales] == names
    for scale in scales:
        assert isinstance(scale, ScaleItem)
        assert (scale.least, scale.most, scale.step) == (0, 100, 5)
        ends = (scale.low["en"], scale.high["en"])
        assert ends == (("Good", "Poor") if scale.name == "performance" else ("Low", "High"))


def test_every_question_of_the_comprehension_check_has_a_right_answer() -> None:
    check = questionnaire("comprehension")
    assert len(check) == 3
    assert all(isinstance(item, ChoiceItem) and item.right for item in check)


def test_the_right_answers_of_the_comprehension_check_have_no_pattern() -> None:
    check = questionnaire("comprehension")
    places = [[option.name for option in item.options].index(item.right) for item in check]
    assert len(set(places)) == len(places)


def test_the_showcase_has_every_kind_of_step_of_item_and_of_ending() -> None:
    kinds = {get_args(step)[0].model_fields["step"].annotation for step in get_args(get_args(Step)[0])}
    assert {step.step for step in FULL_PATH.path} == {get_args(kind)[0] for kind in kinds}
    asked = {item.kind for each in FULL_PATH.questionnaire.values() for item in each}
    assert asked == {"number", "likert", "choice", "scale", "text"}
    assert set(FULL_PATH.endings) == set(Ending)
    codes = [ending.code for ending in FULL_PATH.endings.values()]
    assert len(set(codes)) == len(Ending)


def test_the_showcase_is_short_and_has_queries_of_every_kind() -> None:
    protocol = FULL_PATH.protocol
    assert (protocol.active_queries, protocol.test_queries) == (6, 3)
    assert (protocol.repeats, protocol.checks) == (2, 1)
    assert FULL_PATH.languages == LANGUAGES
