"""What somebody answered to a questionnaire: read from a page's fields, and checked item by item."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from study_core.path import ChoiceItem, Item, LikertItem, NumberItem, ScaleItem, TextItem

Value = float | int | str | list[str] | None

_WHOLE = re.compile(r"[-+−]?\d{1,15}")
_NUMBER = re.compile(rf"{_WHOLE.pattern}([.,]\d{{1,15}})?")
# Of a step: how far off a number may be that went through decimals.
_TOLERANCE = 1e-6


class Problem(StrEnum):
    """What is wrong with an answer."""

    MISSING = "missing"
    NOT_A_NUMBER = "not-a-number"
    NOT_WHOLE = "not-whole"
    TOO_SMALL = "too-small"
    TOO_LARGE = "too-large"
    TOO_LONG = "too-long"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Checked:
    """A questionnaire as it was filled in.

    Attributes:
        values: By item; None where nothing was answered that needn't be.
        problems: By item.
    """

    values: dict[str, Value] = field(default_factory=dict)
    problems: dict[str, Problem] = field(default_factory=dict)


def check(items: Sequence[Item], form: Mapping[str, Sequence[str]]) -> Checked:
    """Returns the answers in a page's fields, which are named as the items are.

    Free text is what was typed, to the last space. Options stand in the questionnaire's order.

    Args:
        items: The questionnaire.
        form: Each field with all its values, as the browser sent it; fields that are no items say nothing.
    """
    values: dict[str, Value] = {}
    problems: dict[str, Problem] = {}
    for item in items:
        answer = _read(item, form.get(item.name, ()))
        if isinstance(answer, Problem):
            problems[item.name] = answer
        else:
            values[item.name] = answer
    return Checked(values, problems)


def example_answer(item: Item) -> str:
    """Returns what a field could hold: the right answer where there is one, and none that screens out."""
    if isinstance(item, TextItem):
        return "-"
    if isinstance(item, ChoiceItem):
        names = [option.name for option in item.options]
        return item.right or next((name for name in names if name not in item.screens_out), names[0])
    if isinstance(item, NumberItem):
        return str(_example_number(item))
    return str(_plain(_scale(item)[0]))


def random_answer(item: Item, rng: np.random.Generator) -> str:
    """Returns something that a field could hold, whatever is right and whatever screens out."""
    if isinstance(item, TextItem):
        return "-"
    if isinstance(item, ChoiceItem):
        return item.options[int(rng.integers(len(item.options)))].name
    if isinstance(item, NumberItem):
        least = 0.0 if item.least is None else item.least
        most = least + 100.0 if item.most is None else item.most
        return str(
            int(rng.integers(math.ceil(least), math.floor(most) + 1))
            if item.whole
            else rng.uniform(least, most)
        )
    least, most, step = _scale(item)
    return str(_plain(least + step * int(rng.integers(int((most - least) / step) + 1))))


def is_right(items: Sequence[Item], values: Mapping[str, Value]) -> bool:
    """Returns whether every item that has a right answer got it."""
    rights = {item.name: item.right for item in items if isinstance(item, (NumberItem, ChoiceItem))}
    return all(values.get(name) in (right, [right]) for name, right in rights.items() if right is not None)


def screens_out(items: Sequence[Item], values: Mapping[str, Value]) -> bool:
    """Returns whether an answer is one that ends the session."""
    return any(
        _is_among(values.get(item.name), item.screens_out)
        for item in items
        if isinstance(item, (NumberItem, ChoiceItem))
    )


def _is_among(value: Value, those: Sequence[Any]) -> bool:
    return any(one in those for one in value) if isinstance(value, list) else value in those


def _read(item: Item, sent: Sequence[str]) -> Value | Problem:
    if isinstance(item, TextItem):
        return _text(item, sent[0] if sent else "")
    given = [value.strip() for value in sent if value.strip()]
    if not given:
        return Problem.MISSING if item.required else None
    if isinstance(item, ChoiceItem):
        return _chosen(item, given)
    if isinstance(item, NumberItem):
        return _typed_number(item, given[0])
    return _position(item, given[0])


def _text(item: TextItem, text: str) -> Value | Problem:
    if item.required and not text.strip():
        return Problem.MISSING
    return Problem.TOO_LONG if len(text) > item.longest else text or None


def _chosen(item: ChoiceItem, given: list[str]) -> Value | Problem:
    chosen = [option.name for option in item.options if option.name in given]
    if len(chosen) < len(set(given)) or (len(chosen) > 1 and not item.several):
        return Problem.UNKNOWN
    return chosen if item.several else chosen[0]


def _typed_number(item: NumberItem, text: str) -> Value | Problem:
    number = _number(text)
    if number is None:
        return Problem.NOT_A_NUMBER
    # 1.000 is a thousand to some and one to others: where numbers are whole, it is neither.
    if item.whole and not _WHOLE.fullmatch(text):
        return Problem.NOT_WHOLE
    if item.least is not None and number < item.least:
        return Problem.TOO_SMALL
    if item.most is not None and number > item.most:
        return Problem.TOO_LARGE
    return _plain(number)


def _position(item: ScaleItem | LikertItem, text: str) -> Value | Problem:
    number = _number(text)
    least, most, step = _scale(item)
    if number is None or not least <= number <= most:
        return Problem.UNKNOWN
    steps = (number - least) / step
    return Problem.UNKNOWN if abs(steps - round(steps)) > _TOLERANCE else _plain(number)


def _scale(item: ScaleItem | LikertItem) -> tuple[float, float, float]:
    """Returns a scale's least and greatest value and its step."""
    return (
        (1.0, float(item.points), 1.0) if isinstance(item, LikertItem) else (item.least, item.most, item.step)
    )


def _number(text: str) -> float | None:
    """Returns a number in digits, whether its decimals follow a point or a comma."""
    return float(text.replace(",", ".").replace("−", "-")) if _NUMBER.fullmatch(text) else None


def _plain(number: float) -> float | int:
    return int(number) if number.is_integer() else number


def _example_number(item: NumberItem) -> float | int:
    if item.right is not None:
        return _plain(item.right)
    start = min(0.0, item.most or 0.0) if item.least is None else item.least
    first = math.ceil(start) if item.whole else _plain(start)
    candidates = [first + k for k in range(len(item.screens_out) + 1)]
    return next((number for number in candidates if number not in item.screens_out), first)
