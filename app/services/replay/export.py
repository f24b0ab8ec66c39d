"""Reproducing a whole export: everybody in it, each derived again, or verified step by step on another machine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from app.machine import machine
from app.services.export import Export
from app.services.replay.derivation import derive
from app.services.replay.person import ExportedPerson, exported_person
from app.services.replay.steps import verify_steps
from app.services.replay.tables import compare_posteriors, compare_tables
from app.services.replay.versions import require_same_bank, require_same_versions
from app.services.runtime import Runtime
from study_core.errors import ScriptError
from study_core.queries import Participant
from study_core.study import Study
from study_core.verification.session import Verifier

Way = Literal["derived", "verified"]


@dataclass(frozen=True)
class Survey:
    """Who is in an export.

    Attributes:
        n_people: Who can be derived again.
        n_queries: All that these were asked.
        left_out: Why the others are.
        studies: Of those who can.
    """

    n_people: int
    n_queries: int
    left_out: tuple[str, ...]
    studies: tuple[Study, ...]


@dataclass(frozen=True)
class PersonReplayed:
    """What was made of one person.

    Attributes:
        source: What to call them.
        study: Their study.
        participant: Names their session's random streams.
        way: Whether their queries were derived again, or each step was verified.
        n_queries: How many.
        other_machines: Types of processors that had computed some of them, and aren't this one.
        not_verified: What couldn't be looked at, with how often.
    """

    source: str
    study: Study
    participant: Participant
    way: Way
    n_queries: int
    other_machines: tuple[str, ...]
    not_verified: Counter[str] = field(default_factory=Counter)


def survey(export: Export) -> Survey:
    """Looks at everybody in an export, before anything is computed.

    Raises:
        OtherVersionError: Something was computed by other versions than those installed.
        ReplayDifferenceError: An entry of a log can't be read.
        ScriptError: Nobody can be derived again.
    """
    n_people, n_queries, left_out = 0, 0, []
    studies: dict[str, Study] = {}
    for person in people_of(export):
        if person.hindrance:
            left_out.append(person.hindrance)
            continue
        require_same_versions(person)
        n_people, n_queries = n_people + 1, n_queries + len(person.queries)
        studies[person.study.hash] = person.study
    if not n_people:
        why = f" {left_out[0]}" if left_out else ""
        raise ScriptError(
            f"{export.folder}: expected somebody whose queries can be derived again, found nobody.{why} Export again "
            "with others."
        )
    return Survey(n_people, n_queries, tuple(left_out), tuple(studies.values()))


class Reproduction:
    """An export that is being reproduced."""

    def __init__(self, runtime: Runtime, export: Export, by_steps: bool) -> None:
        """Computes nothing yet.

        Args:
            runtime: What computes.
            export: Whose people.
            by_steps: Whether each step is to be verified alone also where everything can be derived again.
        """
        self._runtime = runtime
        self._export = export
        self._by_steps = by_steps
        self._verifiers: dict[str, Verifier] = {}

    def run(self, on_query: Callable[[], None] = lambda: None) -> Iterator[PersonReplayed]:
        """Gives everybody who can be derived again, one after the other, once they have been.

        Raises:
            ReplayDifferenceError: Something isn't what was stored; the message names person, query and number.
            OtherVersionError: A query was chosen from another bank.
            ScriptError: Steps are to be verified, and the samples weren't exported.
        """
        for person in people_of(self._export):
            if not person.hindrance:
                yield self._one(person, on_query)

    def _one(self, person: ExportedPerson, on_query: Callable[[], None]) -> PersonReplayed:
        participant = person.state.participant
        assert participant is not None, "who was asked something has begun"
        elsewhere = tuple(sorted(person.machines - {machine()}))
        way: Way = "verified" if self._by_steps or elsewhere else "derived"
        not_verified: Counter[str] = Counter()
        if way == "derived":
            require_same_bank(person)
            posteriors = derive(self._runtime, person, on_query)
            compare_posteriors(self._export, person, posteriors)
        else:
            verifier = self._verifiers.setdefault(person.study.hash, Verifier(person.study))
            not_verified = verify_steps(verifier, self._export, person, on_query).left_out
        # Now that the log is known to be right, a table that says something else is wrong.
        compare_tables(self._export, person)
        return PersonReplayed(
            person.source, person.study, participant, way, len(person.queries), elsewhere, not_verified
        )


def people_of(export: Export) -> Iterator[ExportedPerson]:
    """Gives everybody in an export, in the order of its table `people`.

    Raises:
        ReplayDifferenceError: An entry of a log can't be read.
    """
    return (exported_person(export, row) for row in export.people())
