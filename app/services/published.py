"""Taking the published study's people into the store, as sessions that were finished elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from app.settings import find_study
from app.store import ImportedSession, NewEvent, PosteriorRecord, Store
from study_core import session_codec
from study_core.published import find_files
from study_core.published_session import PublishedSession, read_session
from study_core.study import Study

PROTOCOL = "katz2021-code"
"""The study that the published code ran."""

# One chain of 100 samples, whose draws weren't published: nothing can be said of its convergence.
_UNDIAGNOSED = ("acceptance", "n_draws", "has_converged")
_WARNING = "drawn by the published code; not diagnosed"


@dataclass(frozen=True)
class ImportedPerson:
    """What became of one person.

    Attributes:
        number: As in the paper's data.
        session_id: Of the new session; None if the same files were imported before.
        n_active: Active queries, all answered.
        n_test: Test queries, all answered.
        files: Name and SHA-256 of the files it was read from.
    """

    number: int
    session_id: str | None
    n_active: int
    n_test: int
    files: dict[str, str]


def read_people(directory: Path, on_person: Callable[[int, int], None]) -> list[PublishedSession]:
    """Reads everyone in a folder; nothing is stored.

    Args:
        directory: The published study's JLD2 files; any subset of the people.
        on_person: Told how many people are read, and of how many.

    Raises:
        PublishedDataError: There is nobody, or a file can't be used.
    """
    protocol, code_version = find_study(PROTOCOL), version("prefstudy")
    files = find_files(directory)
    people = []
    for train_path, test_path in files.values():
        people.append(read_session(train_path, test_path, protocol, code_version))
        on_person(len(people), len(files))
    return people


def import_person(store: Store, person: PublishedSession) -> ImportedPerson:
    """Stores one person, all or nothing; somebody who is there already stays as they are."""
    record = store.add_imported(
        ImportedSession(
            digest=person.digest,
            study_hash=person.study.hash,
            study_name=person.study.name,
            study_text=person.study.text,
            events=tuple(
                NewEvent(session_codec.kind_of(event), session_codec.to_json(event))
                for event in person.events
            ),
            posteriors=_posteriors(person),
        )
    )
    protocol = person.study.protocol
    files = {file.path.name: file.sha256 for file in person.files}
    session_id = None if record is None else record.id
    return ImportedPerson(person.number, session_id, protocol.active_queries, protocol.test_queries, files)


def _posteriors(person: PublishedSession) -> tuple[PosteriorRecord, ...]:
    summary = _summary(person.study)
    return tuple(
        PosteriorRecord(query_index, samples.mean(axis=0), samples, summary)
        for query_index, samples in person.posterior_samples.items()
    )


def _summary(study: Study) -> dict[str, object]:
    """Returns what a posterior of ours says of itself, as far as it is known."""
    unknown = [None] * len(study.domain.feature_names)
    response = study.response
    fixed = {
        "rationality": response.rationality,
        "lapse_rate": response.lapse_rate,
        "tie_threshold": response.tie_threshold,
    }
    return {
        **dict.fromkeys(("r_hat", "ess_bulk", "ess_tail"), unknown),
        **dict.fromkeys(_UNDIAGNOSED),
        "warning": _WARNING,
        **{name: dict.fromkeys(("q05", "median", "q95"), value) for name, value in fixed.items()},
    }
