"""A questionnaire on its page: what is asked, in the person's language, what they have filled in, what to mend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.web.languages import format_number, translator
from study_core.path import Item
from study_core.questionnaire import Problem
from study_core.section import words_in


@dataclass(frozen=True)
class Field:
    """One item of a questionnaire, as its page shows it.

    Attributes:
        item: What is asked: its name (the form's field is called the same), kind, whether it is required, and what its
            kind has besides: least, most, step, points, several, longest.
        label: The question.
        low: What the lowest value means, on a scale.
        high: What the highest means.
        options: Of a choice: name, which is the field's value, and label.
        filled_in: The field's values as they were sent before, to be shown again.
        problem: What has to be mended, if anything.
    """

    item: Item
    label: str
    low: str
    high: str
    options: tuple[tuple[str, str], ...]
    filled_in: tuple[str, ...]
    problem: str | None


def fields(
    items: Sequence[Item],
    language: str,
    form: Mapping[str, Sequence[str]] | None = None,
    problems: Mapping[str, Problem] | None = None,
) -> list[Field]:
    """Returns what the page of a questionnaire shows.

    Args:
        items: What is asked.
        language: BCP 47 tag of one of the study's languages.
        form: What the person has sent, if some of it has to be mended.
        problems: By item, what has to be mended.
    """
    return [
        _field(item, language, (form or {}).get(item.name, ()), (problems or {}).get(item.name))
        for item in items
    ]


def _field(item: Item, language: str, filled_in: Sequence[str], problem: Problem | None) -> Field:
    def said(key: str) -> str:
        words = getattr(item, key, None)
        return "" if words is None else words_in(words, language)

    options = tuple(
        (option.name, words_in(option.label, language)) for option in getattr(item, "options", ())
    )
    hint = None if problem is None else what_to_mend(item, problem, language)
    return Field(item, said("label"), said("low"), said("high"), options, tuple(filled_in), hint)


def what_to_mend(item: Item, problem: Problem, language: str) -> str:
    """Returns what to tell somebody whose answer can't be taken as it is."""
    words = translator(language)
    match problem:
        case Problem.MISSING:
            return words.gettext("Please answer this question.")
        case Problem.NOT_A_NUMBER:
            return words.gettext("Please enter a number in digits.")
        case Problem.NOT_WHOLE:
            return words.gettext("Please enter a whole number, without point or comma.")
        case Problem.TOO_SMALL:
            limit = _number(item, "least", language)
            return words.gettext("Please enter a number that is at least %(least)s.") % {"least": limit}
        case Problem.TOO_LARGE:
            limit = _number(item, "most", language)
            return words.gettext("Please enter a number that is at most %(most)s.") % {"most": limit}
        case Problem.TOO_LONG:
            limit = _number(item, "longest", language)
            return words.gettext("Please shorten this to at most %(longest)s characters.") % {
                "longest": limit
            }
        case Problem.UNKNOWN:
            return words.gettext("Please choose one of the answers shown.")


def _number(item: Any, key: str, language: str) -> str:
    return format_number(getattr(item, key), language)
