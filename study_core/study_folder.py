"""What stands beside a study file: texts and questionnaires, put into the study's text so that it is whole.

`NAME.LANGUAGE.md` is a text, `NAME.toml` a questionnaire with `[[item]]` tables. A study's own folder, called as its
file without the ending, goes before the library of ready ones, where they are in the folders `texts` and
`questionnaires`. A text is taken from one of them in all its languages, so that no two people read different things.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from study_core.errors import StudyError
from study_core.path import (
    QUERIES_ALONE,
    EndingSection,
    needed_questionnaires,
    needed_texts,
)
from study_core.path import Path as Steps
from study_core.section import Language

Json = dict[str, Any]


class _Named(BaseModel):
    """What a study file names, and what it holds of it; the rest of the file is read later."""

    model_config = ConfigDict(extra="ignore", strict=True)

    languages: tuple[Language, ...] = ("en",)
    path: Steps = QUERIES_ALONE
    endings: dict[str, EndingSection] = Field({})
    text: Json = Field({})
    questionnaire: Json = Field({})

    @field_validator("languages", "path", mode="before")
    @classmethod
    def _list_is_tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value


def with_its_folder(text: str, folder: Path, library: Path | None) -> str:
    """Returns a study file's text, completed by what it names and does not hold.

    What is nowhere to be found is left for the check of the whole study to name, and so is a file that names wrongly.

    Args:
        text: The file's.
        folder: The study's own; need not exist.
        library: Folder of ready texts and questionnaires.

    Raises:
        StudyError: A file that is there can't be read, or the text has no place for what it holds.
    """
    try:
        named = _Named.model_validate(tomllib.loads(text))
    except (tomllib.TOMLDecodeError, ValidationError):
        return text
    libraries = [] if library is None else [library]
    added = {
        "text": _texts(named, [folder, *(each / "texts" for each in libraries)]),
        "questionnaire": _questionnaires(named, [folder, *(each / "questionnaires" for each in libraries)]),
    }
    added = {section: entries for section, entries in added.items() if entries}
    return _joined(text, added) if added else text


def _texts(named: _Named, folders: Sequence[Path]) -> Json:
    texts: Json = {}
    for name in needed_texts(named.path, named.endings):
        if name in named.text:
            continue
        in_each = (
            {language: folder / f"{name}.{language}.md" for language in named.languages} for folder in folders
        )
        there = ({language: path for language, path in paths.items() if path.is_file()} for paths in in_each)
        first = next(filter(None, there), {})
        if first:
            texts[name] = {language: _read(path) for language, path in first.items()}
    return texts


def _questionnaires(named: _Named, folders: Sequence[Path]) -> Json:
    questionnaires: Json = {}
    for name in needed_questionnaires(named.path):
        paths = (folder / f"{name}.toml" for folder in folders)
        path = next((path for path in paths if path.is_file()), None)
        if path is not None and name not in named.questionnaire:
            questionnaires[name] = _items(path)
    return questionnaires


def _items(path: Path) -> list[Json]:
    try:
        items: list[Json] = tomllib.loads(_read(path))["item"]
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: not valid TOML: {error}. Mend that line.") from error
    except KeyError as error:
        raise StudyError(f"{path}: expected [[item]] tables, found none. Add the questions.") from error
    return items


def _joined(text: str, added: Json) -> str:
    # Multi-line strings keep a text readable where a session keeps it for ever.
    appendix = tomli_w.dumps(added, multiline_strings=True)
    joined = f"{text.rstrip()}\n\n# From the study's folder and the ready texts.\n{appendix}"
    try:
        tomllib.loads(joined)
    except tomllib.TOMLDecodeError as error:
        sections = " and ".join(f"[{section}]" for section in added)
        raise StudyError(
            f"Expected {sections} as sections of their own, to which files can add, got tables in one line: {error}. "
            "Write each entry in a line below the section's name."
        ) from error
    return joined


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"Can't read {path}: {error}. Save it as UTF-8 text.") from error
