"""A person of the published study as a session of ours: the log that a live session would have left."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float

from study_core.comparison import Choice, ComparisonSet, Query
from study_core.domains.driving import DRIVING_V1
from study_core.domains.driving.recover import recover_controls
from study_core.errors import NotATrajectoryError, PublishedDataError
from study_core.events import AnswerGiven, Event, QueryPrepared, SessionBegun
from study_core.plan import Phase
from study_core.published import PublishedPerson, read_person
from study_core.queries import Imported, ProposedQuery
from study_core.session import reduce
from study_core.study import Study, parse_study

STUDY_NAME = "katz2021-published"
"""Of the study that imported people belong to."""

PARTICIPANT_PREFIX = "published-"
"""What names their random streams, before the person's number in the paper's data."""

# Stored differences of features come back to 1e-12; what differs by more belongs to other drives.
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class SourceFile:
    """A file of the published study, as it was read.

    Attributes:
        path: Where it was.
        sha256: Of its content, in hex.
    """

    path: Path
    sha256: str


@dataclass(frozen=True)
class PublishedSession:
    """One person of the published study as a finished session.

    Attributes:
        number: The person's, as in the paper's data.
        files: What it was read from: their training file, then their test file.
        study: The published protocol with as many queries as the person answered.
        events: The log, in order.
        posterior_samples: By query index, the samples of w from which the query was chosen, each `(100, 4)`.
    """

    number: int
    files: tuple[SourceFile, SourceFile]
    study: Study
    events: tuple[Event, ...]
    posterior_samples: dict[int, Float[np.ndarray, "100 4"]]

    @cached_property
    def digest(self) -> str:
        """Returns the SHA-256 that names both files' contents, whatever they are called."""
        return hashlib.sha256(" ".join(file.sha256 for file in self.files).encode()).hexdigest()


def read_session(train_path: Path, test_path: Path, protocol: Study, code_version: str) -> PublishedSession:
    """Returns a person's session.

    Args:
        train_path: Their file of active queries.
        test_path: Their file of test queries.
        protocol: The published code's study, of which only the name and the numbers of queries are changed.
        code_version: Version of prefstudy.

    Raises:
        PublishedDataError: A file is missing, damaged, or holds something else than answers to drives of driving-v1.
    """
    person = read_person(train_path, test_path)
    train_file, test_file = _source_file(train_path), _source_file(test_path)
    study = _study_of(person, protocol)
    active = _queries(train_file, person.training, person.training_states)
    test = _queries(test_file, person.test, person.test_states)
    events: list[Event] = [SessionBegun(f"{PARTICIPANT_PREFIX}{person.number}")]
    for index, (proposed, choice) in enumerate((*active, *test)):
        phase = Phase.ACTIVE if index < len(active) else Phase.TEST
        events.append(QueryPrepared(index, phase, proposed, {}, code_version, None, None))
        events.append(AnswerGiven(index, choice, None))
    reduce(study, events)
    return PublishedSession(
        person.number, (train_file, test_file), study, tuple(events), _posterior_samples(train_path, person)
    )


def _source_file(path: Path) -> SourceFile:
    with path.open("rb") as file:
        return SourceFile(path, hashlib.file_digest(file, "sha256").hexdigest())


def _study_of(person: PublishedPerson, protocol: Study) -> Study:
    """Returns the protocol with as many queries as the person answered; one stopped after 82."""
    text = re.sub(r'^name = ".*"$', f'name = "{STUDY_NAME}"', protocol.text, count=1, flags=re.MULTILINE)
    for key, n in (("active_queries", len(person.training)), ("test_queries", len(person.test))):
        text = re.sub(rf"^{key} = \d+", f"{key} = {n}", text, count=1, flags=re.MULTILINE)
    return parse_study(text, source=STUDY_NAME)


def _queries(
    file: SourceFile, answers: ComparisonSet, states: Float[np.ndarray, "n 2 50 4"]
) -> list[tuple[ProposedQuery, Choice]]:
    """Returns every query of a file with its answer; A is the drive that was stored first."""
    try:
        controls = recover_controls(states.reshape(-1, 50, 4))
    except NotATrajectoryError as error:
        raise PublishedDataError(f"Can't use {file.path}: {error}") from error
    features = DRIVING_V1.features(DRIVING_V1.rollout(controls)).reshape(-1, 2, 4)
    _require_features(file, answers, features)
    proposed = (
        ProposedQuery(Query(*pair, *phi), Imported(file.path.name, file.sha256, entry))
        for entry, (pair, phi) in enumerate(zip(controls.reshape(-1, 2, 10), features, strict=True))
    )
    choices = (Choice.A if sign > 0 else Choice.B for sign in answers.signs)
    return list(zip(proposed, choices, strict=True))


def _require_features(file: SourceFile, answers: ComparisonSet, features: Float[np.ndarray, "n 2 4"]) -> None:
    errors = np.abs(features[:, 0] - features[:, 1] - answers.feature_diffs).max(axis=1)
    wrong = np.flatnonzero(errors > _TOLERANCE)
    if len(wrong):
        raise PublishedDataError(
            f"Can't use {file.path}: expected the difference of both drives' features, got entry {wrong[0]}, which "
            f"is {errors[wrong[0]]:.1e} off. Fetch it again."
        )


def _posterior_samples(path: Path, person: PublishedPerson) -> dict[int, Float[np.ndarray, "100 4"]]:
    """Returns the samples by the query that was chosen from them; a prior drawn twice counts once."""
    n_queries, samples = len(person.training), person.posterior_samples
    n_extra = len(samples) - n_queries
    if n_extra not in (0, 1):
        raise PublishedDataError(
            f"Can't use {path}: expected {n_queries} or {n_queries + 1} sets of samples for {n_queries} queries, "
            f"got {len(samples)}. Fetch it again."
        )
    return dict(enumerate(samples[n_extra:]))
