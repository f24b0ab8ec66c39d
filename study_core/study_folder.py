"""What stands beside a study file: texts and questionnaires, put into the study's text so that it is whole.

`NAME.LANGUAGE.md` is a text, `NAME.toml` a questionnaire with `[[item]]` tables. A study's own folder, called as its
file without the ending, goes before the library of ready ones, where they are in the folders `texts` and
`questionnaires`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import tomli_w

from study_core.errors import StudyError

Json = dict[str, Any]


def with_its_folder(text: str, folder: Path, library: Path | None) -> str:
    """Returns a study file's text, completed by what it names and does not hold.

    What is nowhere to be found is left for the check of the whole study to name.

    Args:
        text: The file's.
        folder: The study's own; need not exist.
        library: Folder of ready texts and questionnaires.

    Raises:
        StudyError: A file that is there can't be read.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return text
    text_folders = [folder] if library is None else [folder, library / "texts"]
    questionnaire_folders = [folder] if library is None else [folder, library / "questionnaires"]
    added: Json = {}
    texts = _texts(_missing_texts(content), _languages(content), text_folders)
    questionnaires = _questionnaires(_missing_questionnaires(content), questionnaire_folders)
    if texts:
        added["text"] = texts
    if questionnaires:
        added["questionnaire"] = questionnaires
    if not added:
        return text
    appendix = tomli_w.dumps(added, multiline_strings=True)
    return f"{text.rstrip()}\n\n# From the study's folder and the ready texts.\n{appendix}"


def _languages(content: Json) -> list[str]:
    languages = content.get("languages", ["en"])
    return [one for one in languages if isinstance(one, str)] if isinstance(languages, list) else []


def _tables(value: object) -> list[Json]:
    """Returns the tables in a list; anything else is the study's check to refuse."""
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []


def _names(values: Iterable[object]) -> list[str]:
    return [value for value in dict.fromkeys(values) if isinstance(value, str) and _is_file_name(value)]


def _is_file_name(name: str) -> bool:
    return bool(name) and not {"/", "\\", ".", "\0"} & set(name)


def _missing_texts(content: Json) -> list[str]:
    steps = _tables(content.get("path"))
    shown = [
        step.get("text", "break" if step.get("step") == "queries" else step.get("step")) for step in steps
    ]
    endings = content.get("endings")
    ends = list(endings.values()) if isinstance(endings, dict) else []
    there = content.get("text")
    names = _names(["welcome", "question", "thanks", *shown, *(end.get("text") for end in _tables(ends))])
    return [name for name in names if not isinstance(there, dict) or name not in there]


def _missing_questionnaires(content: Json) -> list[str]:
    there = content.get("questionnaire")
    steps = _tables(content.get("path"))
    names = _names(step.get(key) for step in steps for key in ("questionnaire", "check"))
    return [name for name in names if not isinstance(there, dict) or name not in there]


def _texts(names: list[str], languages: list[str], folders: list[Path]) -> Json:
    texts: Json = {}
    for name in names:
        found = {language: _first(folders, f"{name}.{language}.md") for language in languages}
        read = {language: _read(path) for language, path in found.items() if path is not None}
        if read:
            texts[name] = read
    return texts


def _questionnaires(names: list[str], folders: list[Path]) -> Json:
    questionnaires: Json = {}
    for name in names:
        path = _first(folders, f"{name}.toml")
        if path is None:
            continue
        try:
            questionnaires[name] = tomllib.loads(_read(path))["item"]
        except tomllib.TOMLDecodeError as error:
            raise StudyError(f"{path}: not valid TOML: {error}. Mend that line.") from error
        except KeyError as error:
            raise StudyError(f"{path}: expected [[item]] tables, found none. Add the questions.") from error
    return questionnaires


def _first(folders: list[Path], name: str) -> Path | None:
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"Can't read {path}: {error}. Save it as UTF-8 text.") from error
