"""A participant's path through a study, as its file defines it: steps, questionnaires, endings."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from study_core.section import Name, Section, Words


class Ending(StrEnum):
    """How a session can end."""

    COMPLETED = "completed"
    DECLINED = "declined"
    SCREENED_OUT = "screened-out"
    FAILED = "failed"
    STOPPED = "stopped"
    DELETED = "deleted"
    TIMED_OUT = "timed-out"


class EndingSection(Section):
    """What somebody gets at an ending."""

    code: str | None = Field(None, min_length=1, max_length=100, description="Completion code.")
    redirect: str | None = Field(None, description="Where a button leads, once everything is saved.")
    text: Name | None = Field(None, description="Name of the text on the last page.")

    @field_validator("redirect")
    @classmethod
    def _leads_to_a_page(cls, value: str | None) -> str | None:
        if value is not None and not re.fullmatch(r"https?://[^\s<>\"']+", value):
            raise ValueError(
                "redirect must be an address that begins with https:// or http://, without spaces or quotes"
            )
        return value


class NumberItem(Section):
    """A question for a number."""

    kind: Literal["number"]
    name: Name = Field(description="Of the item, in exports.")
    label: Words = Field(description="The question.")
    required: bool = Field(True, description="Whether it must be answered.")
    least: float | None = Field(None, description="Least answer.")
    most: float | None = Field(None, description="Greatest answer.")
    whole: bool = Field(True, description="Whether it must be a whole number.")
    right: float | None = Field(None, description="The right answer, in a comprehension check.")
    screens_out: tuple[float, ...] = Field((), description="Answers that end the session as screened out.")

    @model_validator(mode="after")
    def _can_be_answered(self) -> NumberItem:
        if self.least is not None and self.most is not None and self.least > self.most:
            raise ValueError(f"least can't be more than most, {self.most}; got {self.least}")
        return self


class ScaleItem(Section):
    """A line between two extremes, without a preset value."""

    kind: Literal["scale"]
    name: Name = Field(description="Of the item, in exports.")
    label: Words = Field(description="The question.")
    required: bool = Field(True, description="Whether it must be answered.")
    least: float = Field(0.0, description="Value of its left end.")
    most: float = Field(100.0, description="Value of its right end.")
    step: float = Field(5.0, gt=0, description="From one value to the next.")
    low: Words = Field(description="What its left end means.")
    high: Words = Field(description="What its right end means.")

    @model_validator(mode="after")
    def _has_steps(self) -> ScaleItem:
        if self.most < self.least + self.step:
            raise ValueError("most must be at least a step above least")
        return self


class LikertItem(Section):
    """A few points from one extreme to the other; answers are 1 to `points`."""

    kind: Literal["likert"]
    name: Name = Field(description="Of the item, in exports.")
    label: Words = Field(description="The question.")
    required: bool = Field(True, description="Whether it must be answered.")
    points: int = Field(7, ge=2, le=11, description="How many.")
    low: Words = Field(description="What the first means.")
    high: Words = Field(description="What the last means.")


class Option(Section):
    """One answer to choose."""

    name: Name = Field(description="Of the option, in exports.")
    label: Words = Field(description="What people read.")


class ChoiceItem(Section):
    """One of several answers, or some of them."""

    kind: Literal["choice"]
    name: Name = Field(description="Of the item, in exports.")
    label: Words = Field(description="The question.")
    required: bool = Field(True, description="Whether it must be answered.")
    options: tuple[Option, ...] = Field(min_length=2, description="What can be chosen.")
    several: bool = Field(False, description="Whether more than one can be chosen.")
    right: Name | None = Field(None, description="The right answer, in a comprehension check.")
    screens_out: tuple[Name, ...] = Field((), description="Answers that end the session as screened out.")

    @model_validator(mode="after")
    def _names_are_its_own(self) -> ChoiceItem:
        names = [option.name for option in self.options]
        if len(set(names)) != len(names):
            raise ValueError("options must have different names")
        unknown = ({self.right} - {None} | set(self.screens_out)) - set(names)
        if unknown:
            raise ValueError(
                f"right and screens_out must name options; {', '.join(sorted(map(str, unknown)))} is none"
            )
        return self


class TextItem(Section):
    """A question for free text."""

    kind: Literal["text"]
    name: Name = Field(description="Of the item, in exports.")
    label: Words = Field(description="The question.")
    required: bool = Field(True, description="Whether it must be answered.")
    longest: int = Field(5000, ge=1, le=20_000, description="Most characters.")


def _told_by(key: str) -> Callable[[Any], str]:
    """Returns what reads off a key which kind of section a value is."""

    def tag(value: Any) -> str:
        return f"<{value.get(key) if isinstance(value, dict) else getattr(value, key, None)}>"

    return tag


Item = Annotated[
    Annotated[NumberItem, Tag("<number>")]
    | Annotated[ScaleItem, Tag("<scale>")]
    | Annotated[LikertItem, Tag("<likert>")]
    | Annotated[ChoiceItem, Tag("<choice>")]
    | Annotated[TextItem, Tag("<text>")],
    Discriminator(
        _told_by("kind"),
        custom_error_type="unknown_kind",
        custom_error_message="kind must be number, scale, likert, choice or text",
    ),
]
"""One question of a questionnaire."""


class ConsentStep(Section):
    """What the person agrees to, or declines."""

    step: Literal["consent"]
    text: Name = Field("consent", description="Name of its text.")


class TextStep(Section):
    """A page that only says something."""

    step: Literal["text"]
    text: Name = Field(description="Name of its text.")


class InstructionsStep(Section):
    """What to do, with an animated example."""

    step: Literal["instructions"]
    text: Name = Field("instructions", description="Name of its text.")
    example: bool = Field(True, description="Shows an animated pair.")


class PracticeStep(Section):
    """Queries that don't count, and questions that show whether the task was understood."""

    step: Literal["practice"]
    text: Name = Field("practice", description="Name of its text, above the check.")
    queries: int = Field(2, ge=1, le=20, description="How many; they teach the model nothing.")
    check: Name | None = Field(None, description="Questionnaire whose items have a right answer.")
    chances: int = Field(2, ge=1, le=5, description="How often the check may be tried.")


class QueriesStep(Section):
    """The study's own queries."""

    step: Literal["queries"] = "queries"
    break_every: int | None = Field(
        None, ge=1, description="Queries from one break to the next; no breaks without it."
    )
    text: Name = Field("break", description="What is said in a break.")


class QuestionnaireStep(Section):
    """A page of questions."""

    step: Literal["questionnaire"]
    questionnaire: Name = Field(description="Name of the questionnaire.")


class DebriefStep(Section):
    """What the study was about."""

    step: Literal["debrief"]
    text: Name = Field("debrief", description="Name of its text.")
    results: bool = Field(False, description="Shows people what was learned about them.")


Step = Annotated[
    Annotated[ConsentStep, Tag("<consent>")]
    | Annotated[TextStep, Tag("<text>")]
    | Annotated[InstructionsStep, Tag("<instructions>")]
    | Annotated[PracticeStep, Tag("<practice>")]
    | Annotated[QueriesStep, Tag("<queries>")]
    | Annotated[QuestionnaireStep, Tag("<questionnaire>")]
    | Annotated[DebriefStep, Tag("<debrief>")],
    Discriminator(
        _told_by("step"),
        custom_error_type="unknown_step",
        custom_error_message=(
            "step must be consent, text, instructions, practice, queries, questionnaire or debrief"
        ),
    ),
]
"""One step of the path."""

Path = tuple[Step, ...]

QUERIES_ALONE: Path = (QueriesStep(),)

Questionnaires = dict[Name, Annotated[tuple[Item, ...], Field(min_length=1, strict=False)]]
"""Questionnaires by name."""

REQUIRED_TEXTS = ("welcome", "question", "thanks")
"""What every study says: on its first page, above every pair, at the end."""


def text_of(step: Step) -> str | None:
    """Returns the name of the text that a step shows, if it shows one."""
    if isinstance(step, QuestionnaireStep) or (isinstance(step, QueriesStep) and step.break_every is None):
        return None
    return step.text


def questionnaire_of(step: Step) -> str | None:
    """Returns the name of the questionnaire that a step asks, if it asks one."""
    if isinstance(step, QuestionnaireStep):
        return step.questionnaire
    return step.check if isinstance(step, PracticeStep) else None


def needed_texts(path: Path, endings: Mapping[str, EndingSection]) -> tuple[str, ...]:
    """Returns the names of all texts that a study with that path and those endings shows, each once."""
    of_steps = [name for name in map(text_of, path) if name is not None]
    of_endings = [ending.text for ending in endings.values() if ending.text is not None]
    return tuple(dict.fromkeys([*REQUIRED_TEXTS, *of_steps, *of_endings]))


def needed_questionnaires(path: Path) -> tuple[str, ...]:
    """Returns the names of all questionnaires that a path asks, each once."""
    return tuple(dict.fromkeys(name for name in map(questionnaire_of, path) if name is not None))
