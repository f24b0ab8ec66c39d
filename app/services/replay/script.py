"""Sessions that somebody has written down: JSON Lines of answers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.services import study as services
from app.services.runtime import Runtime
from app.services.summary import Json, summarise
from app.services.walk import walk
from app.settings import find_study
from study_core.comparison import Choice
from study_core.errors import ScriptError, StudyError
from study_core.events import AnswerGiven, QueryPrepared
from study_core.queries import Participant
from study_core.study import Study


@dataclass(frozen=True)
class Script:
    """A session to run.

    Attributes:
        source: What to call it in messages.
        study: The study.
        participant: Names the session's random streams.
        answers: One for each query, in order.
    """

    source: str
    study: Study
    participant: Participant
    answers: tuple[AnswerGiven, ...]


def replay_script(runtime: Runtime, script: Script) -> Json:
    """Runs a script through the services; returns the session's summary.

    Raises:
        ScriptError: It has too few or too many answers, or they aren't in order.
    """
    _require_count(script)
    # What people before taught is another session's; a script starts from the study file's prior.
    _, record = services.join(runtime, script.study, script.participant, lambda *_: None)
    remaining = iter(script.answers)

    def answer(prepared: QueryPrepared) -> AnswerGiven:
        given = next(remaining)
        if given.query_index != prepared.query_index:
            raise ScriptError(
                f"{script.source}: expected the answer to query {prepared.query_index}, got one to query "
                f"{given.query_index}. Give the answers in order."
            )
        return given

    walk(runtime, record.id, answer)
    return summarise(runtime, record.id)


def _require_count(script: Script) -> None:
    expected, got = script.study.n_queries, len(script.answers)
    if got != expected:
        raise ScriptError(
            f"{script.source}: expected {expected} answers, one for each query of study '{script.study.name}', "
            f"got {got}. Add or remove answers."
        )


def read_script(path: Path) -> Script:
    """Returns the session in a script: JSON Lines of answers.

    Raises:
        ScriptError: A line can't be used; the message names the line.
    """
    lines = _json_lines(path)
    number, header = next(lines, (1, {}))
    try:
        study = find_study(str(header["study"]))
        participant = header.get("participant", 1)
    except (KeyError, StudyError) as error:
        raise ScriptError(
            f'{path}, line {number}: expected a first line like {{"study": "quickstart", "participant": 1}}: {error}'
        ) from error
    answers = tuple(_answer(path, number, content) for number, content in lines)
    return Script(str(path), study, participant, answers)


def _answer(path: Path, number: int, content: Json) -> AnswerGiven:
    choice, index, time_ms = (
        content.get("choice"),
        content.get("query_index"),
        content.get("response_time_ms", 0),
    )
    if choice not in set(Choice) or type(index) is not int or type(time_ms) is not int:
        raise ScriptError(
            f'{path}, line {number}: expected {{"query_index": 0, "choice": "a" or "b", "response_time_ms": 1200}}, '
            f"got {json.dumps(content)}."
        )
    return AnswerGiven(index, Choice(choice), time_ms)


def _json_lines(path: Path) -> Iterator[tuple[int, Json]]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ScriptError(
            f"Can't read {path}: {error}. Give a JSON Lines file or the folder of an export."
        ) from error
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield number, _parsed(path, number, line)


def _parsed(path: Path, number: int, line: str) -> Json:
    try:
        content: Any = json.loads(line)
    except json.JSONDecodeError as error:
        raise ScriptError(f"{path}, line {number}: not JSON: {error}. Mend or remove the line.") from error
    if not isinstance(content, dict):
        raise ScriptError(f"{path}, line {number}: expected a JSON object, got {line[:60]}.")
    return content
