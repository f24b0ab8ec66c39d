"""Where everybody in a study is, how far it has come, and what looks wrong: for whoever runs it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
from jaxtyping import Float

from app.services.health import Lately
from app.services.runtime import Runtime
from app.store import Arm, PersonLine, Source, StudyRecord, UnknownError
from study_core import session_codec
from study_core.comparison import Choice
from study_core.errors import StudyCoreError
from study_core.path import QuestionnaireStep, Step, TextStep
from study_core.study import Study, parse_study

LARGEST_R_HAT = 1.1
"""Chains whose R-hat is larger don't agree on a posterior."""

COMPLETED = "completed"

_UNDER_WAY = timedelta(minutes=10)
_FEWEST_SIDED = 10
_FARTHEST_FROM_HALF = 3.0  # standard errors: one unbiased person in 370
_LONGEST_WAIT_S = 2.0
_LEAST_ROOM = 2 * 1024**3
_WELCOME = "Welcome page"
_STEPS = {
    "consent": "Consent",
    "instructions": "Instructions",
    "practice": "Practice",
    "queries": "Questions",
    "debrief": "Debrief",
}


@dataclass(frozen=True)
class StudySummary:
    """A study of the database.

    Attributes:
        name: Its name.
        title: Its title in its first language; the name where its file can't be read.
        versions: Texts under which sessions were created, newest first; several a version where it has conditions.
        is_served: Whether people can join it here.
        n_completed: People who joined, have completed it and count.
        n_under_way: People who joined, have not ended, and were heard of lately.
        n_people: Sessions of any kind.
        n_places: How many may complete it; None for any number.
    """

    name: str
    title: str
    versions: tuple[StudyRecord, ...]
    is_served: bool
    n_completed: int
    n_under_way: int
    n_people: int
    n_places: int | None


@dataclass(frozen=True, eq=False)
class Person:
    """One person of a study.

    Attributes:
        line: What the store says of them.
        where: The step that they are at, or how they have ended, in words.
        is_over: Whether their session has ended.
        n_queries: How many questions the study has; None where its file can't be read.
        n_test: How many test answers that prefer one have come.
        accuracy: The share of these that their last posterior mean predicts; None without any.
        signs: What looks wrong, in words.
    """

    line: PersonLine
    where: str
    is_over: bool
    n_queries: int | None
    n_test: int
    accuracy: float | None
    signs: tuple[str, ...]

    @property
    def number(self) -> int:
        """Returns what the person is called: their number in their study."""
        return self.line.session.ordinal

    @property
    def counts(self) -> bool:
        """Returns whether nobody has rejected or excluded them."""
        return self.line.review.verdict is None

    @property
    def has_completed(self) -> bool:
        """Returns whether they have gone to the end of the path."""
        return self.line.ending == COMPLETED

    @property
    def taken(self) -> timedelta | None:
        """Returns the time from the beginning to the last thing that happened; None where nothing has."""
        return None if self.line.last_at is None else self.line.last_at - self.line.session.created_at

    @property
    def response_s(self) -> float | None:
        """Returns the mean response time of an answer in seconds."""
        return self.line.response_ms / self.line.n_answers / 1000.0 if self.line.n_answers else None

    @property
    def first_share(self) -> float | None:
        """Returns the share of answers that chose what stood first."""
        return self.line.n_first / self.line.n_sided if self.line.n_sided else None


@dataclass(frozen=True)
class Trouble:
    """A sign of trouble.

    Attributes:
        text: What it is, as a sentence.
        numbers: Of the people it is about; nobody where it is about the server.
    """

    text: str
    numbers: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Overview:
    """A study at a glance.

    Attributes:
        summary: The study.
        people: Those of the kind that was asked for, oldest first.
        arms: By condition, how many have completed and are under way; one without conditions.
        troubles: What looks wrong.
    """

    summary: StudySummary
    people: tuple[Person, ...]
    arms: tuple[Arm, ...]
    troubles: tuple[Trouble, ...]


def study_summaries(runtime: Runtime, served: Study) -> list[StudySummary]:
    """Returns every study of the database, the one that is served first.

    Args:
        runtime: The services' resources.
        served: What people can join.
    """
    names = dict.fromkeys([served.name, *(record.name for record in runtime.store.studies())])
    return [study_summary(runtime, served, name) for name in names]


def study_summary(runtime: Runtime, served: Study, name: str) -> StudySummary:
    """Returns one study.

    Raises:
        UnknownError: There is none of that name.
    """
    return _summary(runtime, served, name, runtime.store.person_lines(name))


def overview(runtime: Runtime, served: Study, name: str, sources: Iterable[Source]) -> Overview:
    """Returns a study with everybody in it.

    Args:
        runtime: The services' resources.
        served: What people can join.
        name: The study's.
        sources: Which kinds of people.

    Raises:
        UnknownError: There is no study of that name.
    """
    wanted = frozenset(sources)
    lines = runtime.store.person_lines(name)
    summary = _summary(runtime, served, name, lines)
    people = _people(runtime, [line for line in lines if line.session.source in wanted])
    study = served if summary.is_served else _study_or_none(runtime, summary.versions[0].study_hash)
    hold_hours = 3.0 if study is None else study.file.recruitment.hold_hours
    arms = runtime.store.arms(name, datetime.now(UTC) - timedelta(hours=hold_hours))
    return Overview(summary, tuple(people), tuple(_every_arm(study, arms)), tuple(_troubles(runtime, people)))


def person_of(runtime: Runtime, session_id: str) -> Person:
    """Returns one person.

    Raises:
        UnknownError: There is no such session.
        SessionDeletedError: It was deleted.
    """
    return _people(runtime, [runtime.store.person_line(session_id)])[0]


def step_name(step: Step) -> str:
    """Returns what a step of a path is called."""
    if isinstance(step, QuestionnaireStep):
        return f"Questionnaire: {step.questionnaire}"
    if isinstance(step, TextStep):
        return f"Text: {step.text}"
    return _STEPS[step.step]


def study_of(runtime: Runtime, study_hash: str) -> Study | None:
    """Returns the study of that hash; None where its file can't be read here, say for want of its domain."""
    return _study_or_none(runtime, study_hash)


def _summary(runtime: Runtime, served: Study, name: str, lines: Sequence[PersonLine]) -> StudySummary:
    versions = tuple(record for record in runtime.store.studies() if record.name == name)
    if not versions:
        raise UnknownError(f"Expected the name of a study, got '{name}'. The desk lists them.")
    is_served = name == served.name
    newest = served if is_served else _study_or_none(runtime, versions[0].study_hash)
    real = [line for line in lines if line.session.source is Source.JOINED and line.review.verdict is None]
    since = datetime.now(UTC) - _UNDER_WAY
    return StudySummary(
        name=name,
        title=name if newest is None else newest.title(newest.languages[0]),
        versions=versions,
        is_served=is_served,
        n_completed=sum(line.ending == COMPLETED for line in real),
        n_under_way=sum(line.ending is None and (line.last_at or since) > since for line in real),
        n_people=len(lines),
        n_places=None if newest is None else newest.file.recruitment.places,
    )


def _every_arm(study: Study | None, arms: Sequence[Arm]) -> list[Arm]:
    """Returns all conditions of a study's newest version, and older ones that somebody has met."""
    known = {arm.condition: arm for arm in arms}
    names = [] if study is None else [arm.condition for arm in study.arms]
    return [known.get(name, Arm(name, 0, 0)) for name in dict.fromkeys([*names, *known])]


def _study_or_none(runtime: Runtime, study_hash: str) -> Study | None:
    try:
        return parse_study(runtime.store.study_text(study_hash))
    except StudyCoreError:
        return None


def _people(runtime: Runtime, lines: Sequence[PersonLine]) -> list[Person]:
    """Returns people with what follows from their study: those of one study all at once."""
    found: dict[str, Person] = {}
    for study_hash in dict.fromkeys(line.session.study_hash for line in lines):
        study = _study_or_none(runtime, study_hash)
        theirs = [line for line in lines if line.session.study_hash == study_hash]
        scores = _accuracies(runtime, study_hash, theirs)
        for line, (accuracy, n_test) in zip(theirs, scores, strict=True):
            found[line.session.id] = Person(
                line=line,
                where=_where(study, line),
                is_over=line.ending is not None,
                n_queries=None if study is None else study.n_queries,
                n_test=n_test,
                accuracy=accuracy,
                signs=tuple(_signs(line)),
            )
    return [found[line.session.id] for line in lines]


def _where(study: Study | None, line: PersonLine) -> str:
    if line.ending is not None:
        return line.ending.replace("-", " ").capitalize()
    if line.n_events == 0:
        return _WELCOME
    if study is None or line.step >= len(study.file.path):
        return f"Step {line.step + 1}"
    return step_name(study.file.path[line.step])


def _accuracies(
    runtime: Runtime, study_hash: str, lines: Sequence[PersonLine]
) -> list[tuple[float | None, int]]:
    """Returns each person's held-out accuracy so far, and from how many answers; all in one matrix product."""
    differences = _test_differences(runtime, study_hash)
    n_test, n_features = differences.shape
    # With a learned feature among them, weights are of more than the test set's stored features.
    scored = [
        index
        for index, line in enumerate(lines)
        if line.mean is not None and len(line.mean) == n_features and 0 < len(line.test_answers) <= n_test
    ]
    results: list[tuple[float | None, int]] = [(None, 0)] * len(lines)
    if not scored:
        return results
    means = np.stack([mean for index in scored if (mean := lines[index].mean) is not None])
    signs = np.array([_signs_of(lines[index].test_answers, n_test) for index in scored])
    is_answered = signs != 0.0
    # A reward difference of exactly 0 predicts neither: it is half right, as in `study_core.evaluation.metrics`.
    right = np.where(is_answered, 0.5 + 0.5 * np.sign(means @ differences.T) * signs, 0.0).sum(axis=1)
    n_answered = is_answered.sum(axis=1)
    for index, n_right, n in zip(scored, right.tolist(), n_answered.tolist(), strict=True):
        results[index] = (n_right / n if n else None, n)
    return results


def _test_differences(runtime: Runtime, study_hash: str) -> Float[np.ndarray, "n_test n_features"]:
    """Returns the feature differences A - B of a study's common test set; nothing where it was never computed here."""
    stored = runtime.store.artifact(f"test-set-{study_hash}")
    if stored is None:
        return np.empty((0, 0))
    queries = [proposed.query.feature_diff for proposed in session_codec.test_set_from_bytes(stored)]
    return np.array(queries) if queries else np.empty((0, 0))


def _signs_of(letters: str, n_test: int) -> list[float]:
    """Returns +1 for an answer A, -1 for B and 0 for none or neither."""
    signs = {Choice.A.value: 1.0, Choice.B.value: -1.0}
    return [signs.get(letter, 0.0) for letter in letters.ljust(n_test)]


def _signs(line: PersonLine) -> Iterable[str]:
    """Gives what looks wrong with one person."""
    if _failed_a_check(line):
        yield f"{line.n_checks - line.n_checks_passed} of {line.n_checks} checks failed"
    if _is_one_sided(line):
        share = line.n_first / line.n_sided
        yield f"{'first' if share > 0.5 else 'second'} in {max(share, 1 - share):.0%}"
    if _has_large_r_hat(line):
        yield f"R-hat {line.r_hat:.2f}"


def has_side_bias(n_first: int, n_sided: int) -> bool:
    """Returns whether so many first choices are three standard errors or more from what chance would give."""
    if n_sided < _FEWEST_SIDED:
        return False
    return abs(n_first - n_sided / 2) >= _FARTHEST_FROM_HALF * math.sqrt(n_sided) / 2


def _troubles(runtime: Runtime, people: Sequence[Person]) -> Iterable[Trouble]:
    yield from map(Trouble, _of_the_server(runtime))
    counted = [person for person in people if person.counts]
    for said, has in _SIGNS_OF_PEOPLE.items():
        numbers = tuple(person.number for person in counted if has(person.line))
        if numbers:
            who = "One person" if len(numbers) == 1 else f"{len(numbers)} people"
            yield Trouble(f"{who} {said}.", numbers)


def _failed_a_check(line: PersonLine) -> bool:
    return line.n_checks > line.n_checks_passed


def _is_one_sided(line: PersonLine) -> bool:
    return has_side_bias(line.n_first, line.n_sided)


def _has_large_r_hat(line: PersonLine) -> bool:
    return line.r_hat is not None and line.r_hat > LARGEST_R_HAT


_SIGNS_OF_PEOPLE = {
    "failed a check": _failed_a_check,
    "chose one side far more often than the other": _is_one_sided,
    f"went on from a posterior whose R-hat is over {LARGEST_R_HAT}": _has_large_r_hat,
}


def _of_the_server(runtime: Runtime) -> Iterable[str]:
    yield from runtime.engine.troubles()
    yield from _slowness(runtime.health.lately())
    room = runtime.store.free_bytes
    if room is not None and room < _LEAST_ROOM:
        yield f"Only {room / 1024**3:.1f} GB are free where the database is. Answers can’t be kept without room."


def _slowness(lately: Lately) -> Iterable[str]:
    long_waits = [wait for wait in lately.waits_s if wait > _LONGEST_WAIT_S]
    if long_waits:
        times = "time" if len(long_waits) == 1 else "times"
        yield (
            f"{len(long_waits)} {times} in the last ten minutes, somebody waited more than {_LONGEST_WAIT_S:.0f} s "
            f"for a question; the longest wait was {max(long_waits):.0f} s. More workers (--workers) help."
        )
    if lately.n_failures:
        times = "time" if lately.n_failures == 1 else "times"
        yield (
            f"A question couldn’t be computed, {lately.n_failures} {times} in the last ten minutes. "
            "The server’s log says why."
        )
