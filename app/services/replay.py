"""Deriving a session again from its answers, headless, and comparing it with what was stored."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.errors import AppError
from app.services import study as services
from app.services.export import open_export
from app.services.runtime import Runtime
from app.services.summary import Json, summarise
from app.services.walk import walk
from app.settings import find_study
from study_core import session_codec
from study_core.comparison import Choice
from study_core.errors import ScriptError, StudyError
from study_core.events import AnswerGiven, FeatureLearned, PopulationAdopted, QueryPrepared
from study_core.queries import Participant
from study_core.replay import first_difference
from study_core.session import reduce
from study_core.study import Study


class ReplayDifferenceError(AppError):
    """A query derived again isn't the one that was asked."""


@dataclass(frozen=True)
class Script:
    """A session to derive again.

    Attributes:
        source: What to call it in messages.
        study: The study.
        participant: Names the session's random streams; None for somebody who never began.
        answers: In order; what was taken back isn't among them, and nothing that stays depends on it.
        stored: The queries as they were asked; None for a script written by hand.
        adopted: What the session started from of the people before, if from anything.
        learned: The features that were learned on the way, as they were stored.
    """

    source: str
    study: Study
    participant: Participant | None
    answers: tuple[AnswerGiven, ...]
    stored: tuple[QueryPrepared, ...] | None = None
    adopted: PopulationAdopted | None = None
    learned: tuple[FeatureLearned, ...] = ()

    @property
    def hindrance(self) -> str:
        """Returns why the queries can't be derived again; empty if they can."""
        if self.participant is None or self.stored == ():
            return f"{self.source}: there is nothing to derive again: this person was asked nothing."
        if self.adopted is None or self.adopted.population is not None:
            return ""
        return (
            f"{self.source}: the queries can't be derived again: somebody whom their start was learned from has been "
            "deleted, and what they taught with them."
        )


def read_scripts(path: Path) -> Iterator[Script]:
    """Gives the sessions in a script (JSON Lines of answers) or in an exported directory.

    Raises:
        ScriptError: It is neither, or a line can't be used; the message names the line.
    """
    if path.is_dir():
        yield from _read_export(path)
    else:
        yield _read_script(path)


def replay(runtime: Runtime, script: Script) -> Json:
    """Runs a script through the services; returns the session's summary.

    Raises:
        ScriptError: It has too few or too many answers, or can't be derived again.
        ReplayDifferenceError: A stored query comes out differently; the message names the number.
    """
    if script.hindrance:
        raise ScriptError(f"{script.hindrance} Leave this person out.")
    if script.stored is None:
        _require_count(script)
    # What people before taught is in the log; what the store knows of them by now is another thing.
    _, record = services.join(runtime, script.study, script.participant, lambda *_: script.adopted)
    remaining = iter(script.answers)

    def answer(prepared: QueryPrepared) -> AnswerGiven:
        _compare(script, prepared)
        given = next(remaining)
        if given.query_index != prepared.query_index:
            raise ScriptError(
                f"{script.source}: expected the answer to query {prepared.query_index}, got one to query "
                f"{given.query_index}. Give the answers in order."
            )
        return given

    # A person who left in the middle answered no more than this.
    with suppress(StopIteration):
        walk(runtime, record.id, answer)
    _compare_learned(script, runtime, record.id)
    return summarise(runtime, record.id)


def _compare(script: Script, derived: QueryPrepared) -> None:
    if script.stored is None or derived.query_index >= len(script.stored):
        return
    difference = first_difference(script.stored[derived.query_index], derived)
    if difference is not None:
        raise ReplayDifferenceError(
            f"{script.source}: query {derived.query_index} is not the one that was asked: {difference}."
        )


def _compare_learned(script: Script, runtime: Runtime, session_id: str) -> None:
    derived = [event for event in runtime.events(session_id) if isinstance(event, FeatureLearned)]
    for stored, again in zip(script.learned, derived, strict=False):
        difference = first_difference(stored, again)
        if difference is not None:
            raise ReplayDifferenceError(
                f"{script.source}: the feature learned before query {stored.query_index} is not the one that the "
                f"session went on with: {difference}."
            )


def _require_count(script: Script) -> None:
    expected, got = script.study.n_queries, len(script.answers)
    if got != expected:
        raise ScriptError(
            f"{script.source}: expected {expected} answers, one for each query of study '{script.study.name}', "
            f"got {got}. Add or remove answers."
        )


def _read_script(path: Path) -> Script:
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
            f"Can't read {path}: {error}. Give a JSON Lines file or an exported directory."
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


def _read_export(folder: Path) -> Iterator[Script]:
    export = open_export(folder)
    people = export.people()
    _refuse_imported(folder, people)
    for person in people:
        person_id = person["person_id"]
        yield _exported_script(
            folder, person_id, export.study(person["study_hash"]), export.events(person_id)
        )


def _refuse_imported(folder: Path, people: list[Json]) -> None:
    imported = [row["person_id"] for row in people if row["source"] == "imported"]
    if imported:
        raise ScriptError(
            f"{folder}: expected queries that prefstudy chose, but another program chose those of {len(imported)} "
            f"imported people, such as {imported[0]}. Export again with --people real or --people rehearsed."
        )


def _exported_script(folder: Path, person_id: str, study: Study, rows: list[Json]) -> Script:
    events = [session_codec.from_json(row["kind"], row["payload"]) for row in rows]
    state = reduce(study, events)
    adopted = next((event for event in events if isinstance(event, PopulationAdopted)), None)
    learned = {event.query_index: event for event in events if isinstance(event, FeatureLearned)}
    return Script(
        f"{folder}, person {person_id}",
        study,
        state.participant,
        state.answers,
        state.prepared,
        adopted,
        tuple(learned.values()),
    )
