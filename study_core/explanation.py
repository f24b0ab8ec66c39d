"""What is said where a study file is wrong: one line that names the key, what was expected there, and what came."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, Tag, ValidationError

from study_core.errors import StudyProblem
from study_core.study_file import StudyFile


def explain(error: ValidationError) -> str:
    """Returns one line about the first thing that is wrong, and how many more there are."""
    problems = explain_all(error)
    line = problems[0].message
    return line if len(problems) == 1 else f"{line} ({len(problems) - 1} more after this one)"


def explain_all(error: ValidationError) -> tuple[StudyProblem, ...]:
    """Returns everything that is wrong, what is misspelt first."""
    # A misspelt key is also a missing one; its own spelling says more.
    problems = sorted(
        error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden"
    )
    return tuple(
        StudyProblem(
            tuple(part for part in problem["loc"] if not _is_tag(part) and part != "[key]"),
            _explain_one(problem),
        )
        for problem in problems
    )


def _explain_one(problem: Any) -> str:
    message = problem["msg"].removeprefix("Value error, ")
    if not problem["loc"]:
        # About several sections together; the message names their keys.
        return _sentence(message)
    # What stands in angle brackets chose between kinds of a value; it isn't a part of the file.
    *section, key = problem["loc"]
    section = [part for part in section if part != "[key]"]
    where = _where([*section, key])
    if problem["type"] == "extra_forbidden":
        known = _keys_of(section)
        close = difflib.get_close_matches(str(key), known, n=1)
        hint = f"did you mean '{close[0]}'?" if close else f"expected one of: {', '.join(known)}."
        return f"unknown key '{where}'; {hint}"
    if problem["type"] == "missing":
        return f"key '{where}' is missing; add it."
    line = f"key '{where}': {message[0].lower()}{message[1:]}"
    # What is wrong with several keys together is said in full; the whole section would only hide it.
    is_whole = isinstance(problem["input"], (dict, list, tuple, BaseModel))
    return _sentence(line) if is_whole else f"{line}, got {problem['input']!r}."


def _sentence(text: str) -> str:
    """Returns a text that begins small, since something stands before it, and ends as a sentence does."""
    return f"{text[0].lower()}{text[1:]}{'' if text.endswith('?') else '.'}"


def _is_tag(part: object) -> bool:
    return isinstance(part, str) and part.startswith("<")


def _where(location: list[Any]) -> str:
    """Returns where something stands in the file; the entries of a list are counted from 1."""
    parts = [part for part in location if not _is_tag(part) and part != "[key]"]
    return ".".join(str(part + 1 if isinstance(part, int) else part) for part in parts)


def _keys_of(section: list[Any]) -> list[str]:
    """Returns the keys that a section of the file knows."""
    kind: Any = StudyFile
    for part in section:
        kind = _kind_at(kind, part)
    return list(_bare(kind).model_fields)


def _kind_at(kind: Any, part: Any) -> Any:
    """Returns the type of a part of a value: of a section's key, of a list's or a table's entry, of a tag's choice."""
    kind = _bare(kind)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return kind.model_fields[str(part)].annotation
    kinds = get_args(kind)
    if _is_tag(part):
        return next(one for one in kinds if Tag(part) in one.__metadata__)
    return kinds[1] if get_origin(kind) is dict else kinds[0]


def _bare(kind: Any) -> Any:
    """Returns a type without its annotations."""
    return get_args(kind)[0] if get_origin(kind) is Annotated else kind
