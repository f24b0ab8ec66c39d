"""A person of an export: their study and their log, and whether their queries can be derived again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from app.services.export import Export
from app.services.export.columns import Row
from app.services.replay.errors import ReplayDifferenceError
from app.store import EventRecord, Source
from study_core import session_codec
from study_core.errors import SessionError
from study_core.events import Event, FeatureLearned, PopulationAdopted, QueryPrepared
from study_core.session import SessionState, reduce
from study_core.study import Study


@dataclass(frozen=True)
class ExportedPerson:
    """A person as an export has them.

    Attributes:
        source: What to call them in messages.
        id: Theirs in the export.
        row: Of the table `people`.
        study: The study that their session was created under.
        records: Their log, as it was exported.
        log: The same, as events.
    """

    source: str
    id: str
    row: Row
    study: Study
    records: tuple[EventRecord, ...]
    log: tuple[Event, ...]

    @cached_property
    def state(self) -> SessionState:
        """Returns where their log leads to.

        Raises:
            ReplayDifferenceError: It holds an event that was not possible when it came.
        """
        try:
            return reduce(self.study, self.log)
        except SessionError as error:
            raise ReplayDifferenceError(f"{self.source}: this log can't have come about: {error}") from error

    @property
    def queries(self) -> tuple[QueryPrepared, ...]:
        """Returns every query that was prepared, also those that stand no longer."""
        return tuple(event for event in self.log if isinstance(event, QueryPrepared))

    @property
    def machines(self) -> set[str]:
        """Returns the types of processors that something was computed on, as far as they were written down."""
        computed = (event for event in self.log if isinstance(event, QueryPrepared | FeatureLearned))
        return {event.machine for event in computed if event.machine is not None}

    @property
    def hindrance(self) -> str:
        """Returns why their queries can't be derived again; empty if they can."""
        if self.row["source"] == Source.IMPORTED.value:
            return f"{self.source}: another program chose the queries of this imported person."
        if not self.queries:
            return f"{self.source}: there is nothing to derive again: this person was asked nothing."
        adopted = (event for event in self.log if isinstance(event, PopulationAdopted))
        if all(event.population is not None for event in adopted):
            return ""
        return (
            f"{self.source}: the queries can't be derived again: somebody whom their start was learned from has been "
            "deleted, and what they taught with them."
        )


def exported_person(export: Export, row: Row) -> ExportedPerson:
    """Returns a person of an export. It is quick in the order of its table `people`.

    Args:
        export: The export.
        row: The person's, of the table `people`.

    Raises:
        ReplayDifferenceError: An entry of their log can't be read.
    """
    source = f"{export.folder}, person {row['person_id']}"
    records = tuple(
        EventRecord(each["position"], each["kind"], each["payload"], each["at"])
        for each in export.events(row["person_id"])
    )
    try:
        log = tuple(session_codec.from_json(record.kind, record.payload) for record in records)
    except SessionError as error:
        raise ReplayDifferenceError(f"{source}: {error}") from error
    return ExportedPerson(source, row["person_id"], row, export.study(row["study_hash"]), records, log)
