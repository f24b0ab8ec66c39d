"""Conditions of an experiment: a study file's arms, each the file with some of its settings changed.

A session is created under the text of its arm: the file's own text, below a line that names the arm. So everything that
is computed from a session's study text is computed for its condition, and the line alone tells the arms apart.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from study_core.section import Name, Section
from study_core.streams import stream

ARM = "arm"
"""Key of the line that names the arm."""

_ARM_LINE = re.compile(rf'\A{ARM} = "([a-z0-9-]+)"\n')

Json = dict[str, Any]
T = TypeVar("T")


class AcquisitionChange(Section):
    """What a condition may change about how the next pair is chosen."""

    method: str | None = Field(None, description="Another acquisition method.")
    mu: float | None = Field(
        None, ge=0, description="Another weight of the distance between the two samples."
    )


class ConditionSection(Section):
    """An arm: what is different for whoever is in it. The common test queries are the same in every arm."""

    name: Name = Field(description="Experimenters and exports see it; participants don't.")
    acquisition: AcquisitionChange = Field(
        AcquisitionChange(), description="How its pairs are chosen instead."
    )
    response: Json = Field({}, description="Keys of the section response, with other values.")
    answering: Json = Field({}, description="Keys of the section answering, with other values.")
    text: Json = Field({}, description="Texts that read differently, by name.")


def arm_text(text: str, condition: str) -> str:
    """Returns the text of one arm of the study file that has this text."""
    return f'{ARM} = "{condition}"\n{text}'


def file_text(text: str) -> str:
    """Returns the text of the study file that a text is of: its own, or the one that it is an arm of."""
    return _ARM_LINE.sub("", text)


def changed(content: Json) -> Json:
    """Returns a study file's content with what its arm changes; as it is where it names no arm that it has."""
    conditions = content.get("condition")
    if ARM not in content or not isinstance(conditions, list):
        return content
    named = (each for each in conditions if isinstance(each, dict) and each.get("name") == content[ARM])
    change = {key: value for key, value in next(named, {}).items() if key != "name"}
    return _merged(content, change)


def _merged(content: Json, change: Json) -> Json:
    both = dict(content)
    for key, value in change.items():
        old = content.get(key)
        both[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return both


def arm_of_rehearsal(seed: int, number: int, n_arms: int) -> int:
    """Returns the arm of a simulated person: of each so many in a row, one in each arm, in random order.

    Unlike real people, whom `choose` sends where somebody is missing, they come to the same arm whoever leaves.
    """
    block, place = divmod(number - 1, n_arms)
    return int(stream(seed, "simulated-condition", block).permutation(n_arms)[place])


def choose(rng: np.random.Generator, conditions: Sequence[T], n_people: Sequence[int]) -> T:
    """Returns the condition of somebody new: one of those that have the fewest people, by chance.

    Args:
        rng: Decides between equals.
        conditions: Their names.
        n_people: How many have completed each, or are under way in it.
    """
    fewest = [name for name, n in zip(conditions, n_people, strict=True) if n == min(n_people)]
    return fewest[int(rng.integers(len(fewest)))]
