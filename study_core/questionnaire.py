"""What somebody answered to a questionnaire: read from a page's fields, and checked item by item."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from study_core.path import ChoiceItem, Item, LikertItem, NumberItem, ScaleItem, TextItem

Value = float | int | str | list[str] | None


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

    Args:
        items: The questionnaire.
        form: Each field with all its values, as the browser sent it.
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
    if isinstance(item, NumberItem) and item.right is not None:
        return str(item.right)
    least, most = _range(item)
    screened = item.screens_out if isinstance(item, NumberItem) else ()
    candidates = [most, least, 0.0 if least is None and most is None else None]
    return str(next((one for one in candidates if one is not None and one not in screened), 0.0))


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
    # What was typed is kept as typed; that it is nothing but space only tells that nothing was answered.
    given = [value for value in sent if value.strip()]
    if not given:
        return Problem.MISSING if item.required else None
    if isinstance(item, TextItem):
        return given[0] if len(given[0]) <= item.longest else Problem.TOO_LONG
    if isinstance(item, ChoiceItem):
        return _chosen(item, given)
    return _number(item, given[0])


def _chosen(item: ChoiceItem, given: list[str]) -> Value | Problem:
    known = {option.name for option in item.options}
    if not set(given) <= known or (len(given) > 1 and not item.several):
        return Problem.UNKNOWN
    return sorted(set(given)) if item.several else given[0]


def _number(item: NumberItem | ScaleItem | LikertItem, text: str) -> Value | Problem:
    # Many people write a decimal comma.
    try:
        value = float(text.strip().replace(",", "."))
    except ValueError:
        return Problem.NOT_A_NUMBER
    if not abs(value) < float("inf"):
        return Problem.NOT_A_NUMBER
    least, most = _range(item)
    if least is not None and value < least:
        return Problem.TOO_SMALL
    if most is not None and value > most:
        return Problem.TOO_LARGE
    is_whole = value == int(value)
    if not is_whole and not isinstance(item, ScaleItem) and (isinstance(item, LikertItem) or item.whole):
        return Problem.NOT_WHOLE
    return int(value) if is_whole else value


def _range(item: NumberItem | ScaleItem | LikertItem) -> tuple[float | None, float | None]:
    return (1, item.points) if isinstance(item, LikertItem) else (item.least, item.most)
