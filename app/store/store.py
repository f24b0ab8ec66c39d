"""The store: the one way to what the application keeps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import datetime
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from app.store import (
    artifacts,
    deletion,
    events,
    external,
    learned,
    measures,
    people,
    posteriors,
    reviews,
    secrets,
    sessions,
    standings,
    studies,
    tokens,
)
from app.store.desk import DeskStore
from app.store.desk_records import Arm, PersonLine, Review
from app.store.engine import Database, parse_url
from app.store.errors import StoreError
from app.store.migrate import ensure_schema, head_version
from app.store.people import PersonRecord
from app.store.records import (
    Deletion,
    EventRecord,
    ExternalPerson,
    ImportedSession,
    MeasureRecord,
    ModelRecord,
    NewEvent,
    NewReport,
    PosteriorRecord,
    SessionRecord,
    Source,
    Standing,
    StudyRecord,
)
from app.store.sqlite import database_path, is_sqlite


def open_store(url: str) -> Store:
    """Opens a database; an empty or missing one gets its tables.

    Args:
        url: The database's URL, such as `sqlite:///study.db`.

    Returns:
        The store; close it when done, or use it as a context manager.

    Raises:
        StoreError: When the database can't be opened, is another program's or has another schema version.
    """
    parsed = parse_url(url)
    ensure_schema(parsed)
    return Store(Database(parsed), head_version())


def open_existing_store(url: str) -> Store:
    """Opens a database that is there: a mistyped name makes no new one.

    Args:
        url: The database's URL.

    Returns:
        The store; see `open_store`.

    Raises:
        StoreError: When there is none, and as `open_store` does.
    """
    parsed = parse_url(url)
    if is_sqlite(parsed) and not database_path(parsed).exists():
        raise StoreError(
            f"Expected a database at '{url}', found none. Name the one that your people are in, with --database."
        )
    return open_store(url)


class Store:
    """Everything the application keeps, for any number of threads.

    Every method is one transaction. What a writing method has returned from is on the disk. Methods raise
    `StoreError` when the database fails them or a session or study isn't known.
    """

    def __init__(self, database: Database, schema_version: str) -> None:
        """Wraps an open database; use `open_store`.

        Args:
            database: An open database with the right schema.
            schema_version: The version of that schema.
        """
        self._database = database
        self.schema_version = schema_version

    def __enter__(self) -> Self:
        """Gives the store itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Closes the store."""
        self.close()

    def close(self) -> None:
        """Closes every connection, after the write that is under way; later calls are refused."""
        self._database.close()

    @property
    def free_bytes(self) -> int | None:
        """How much room is left where the database is; None where that can't be seen from here."""
        return self._database.free_bytes

    @property
    def desk(self) -> DeskStore:
        """What the experimenters' desk keeps."""
        return DeskStore(self._database)

    def put_study(
        self, study_hash: str, name: str, text: str, version: str | None = None, condition: str | None = None
    ) -> None:
        """Keeps a study's text under its hash; doing it twice changes nothing.

        Args:
            study_hash: SHA-256 of the text, in hex.
            name: The study's name.
            text: What a session under it reads.
            version: SHA-256 of the study file's text, where the text is one condition's; the same without conditions.
            condition: The condition's name.

        Raises:
            StoreError: When another text is kept under the hash.
        """
        with self._database.writing() as rows:
            studies.put(rows, study_hash, name, text, version or study_hash, condition)

    def studies(self) -> list[StudyRecord]:
        """Every text that was kept, newest first."""
        with self._database.reading() as rows:
            return studies.every(rows)

    def study_text(self, study_hash: str) -> str:
        """The study text kept under a hash."""
        with self._database.reading() as rows:
            return studies.text(rows, study_hash)

    def study_name(self, study_hash: str) -> str:
        """The name of the study kept under a hash."""
        with self._database.reading() as rows:
            return studies.name(rows, study_hash)

    def create_session(
        self,
        study_hash: str,
        token_hash: str,
        source: Source,
        code_hash: str | None = None,
        person: ExternalPerson | None = None,
        after: str | None = None,
    ) -> SessionRecord:
        """Begins a session under the next free number of its study.

        Args:
            study_hash: A study that was put before.
            token_hash: Hash of the person's secret token; the token itself never comes here.
            source: Who walks it: a participant or a rehearsed person.
            code_hash: Hash of the code that gets the session another token.
            person: Who the person is to whoever sent them.
            after: Id of that person's session before this one.

        Raises:
            TokenTakenError: When the token opens a session already.
            PersonKnownError: When the person's last session is another than `after`.
            StoreError: When the study isn't known.
        """
        with self._database.writing() as rows:
            record = sessions.create(rows, study_hash, source)
            tokens.add(rows, record.id, token_hash, code_hash)
            if person is not None:
                external.add(rows, record.id, person, after)
            return record

    def add_token(self, session_id: str, token_hash: str, code_hash: str | None = None) -> None:
        """Lets another secret token open a session; doing it twice changes nothing.

        Raises:
            TokenTakenError: When it opens another one.
            SessionDeletedError: When the session has been deleted meanwhile.
        """
        with self._database.writing() as rows:
            sessions.by_id(rows, session_id)
            tokens.add(rows, session_id, token_hash, code_hash)

    def add_imported(self, imported: ImportedSession) -> SessionRecord | None:
        """Keeps a whole session that another program ran, with its study: all of it, or nothing.

        Returns:
            The new session, or None if the same was imported before; then nothing has changed.
        """
        with self._database.writing() as rows:
            if sessions.by_import(rows, imported.digest) is not None:
                return None
            studies.put(
                rows,
                imported.study_hash,
                imported.study_name,
                imported.study_text,
                imported.study_hash,
                None,
            )
            rows.flush()
            record = sessions.create(rows, imported.study_hash, Source.IMPORTED, imported.digest)
            sessions.end(rows, record.id, "completed")
            events.append(rows, record.id, 0, imported.events, None)
            for posterior in imported.posteriors:
                posteriors.add(rows, record.id, posterior)
            return record

    def session_by_token(self, token_hash: str) -> SessionRecord | None:
        """The session a token opens, or None."""
        with self._database.reading() as rows:
            return tokens.session(rows, token_hash)

    def session_by_code(self, code_hash: str) -> SessionRecord | None:
        """The session that a code gets another token for, or None."""
        with self._database.reading() as rows:
            return tokens.session_of_code(rows, code_hash)

    def session_of_person(self, study_name: str, external_id: str) -> SessionRecord | None:
        """The newest session of an external id in any version of a study, or None."""
        with self._database.reading() as rows:
            return external.session(rows, study_name, external_id)

    def external_person(self, session_id: str) -> ExternalPerson | None:
        """Who a session's person is to whoever sent them, or None."""
        with self._database.reading() as rows:
            return external.of_session(rows, session_id)

    def arms(self, study_name: str, heard_since: datetime) -> list[Arm]:
        """How many people have completed each condition of a study, or are under way in it, heard of since then.

        Rejected and excluded people count no more. A condition that nobody has met isn't in the list.
        """
        with self._database.reading() as rows:
            return standings.arms(rows, study_name, heard_since)

    def person_lines(self, study_name: str) -> list[PersonLine]:
        """Everybody in a study, whatever the version, oldest first: one quick query."""
        with self._database.reading() as rows:
            return standings.lines(rows, study_name)

    def person_line(self, session_id: str) -> PersonLine:
        """One person of them."""
        with self._database.reading() as rows:
            name = studies.name(rows, sessions.by_id(rows, session_id).study_hash)
            return standings.lines(rows, name, session_id)[0]

    def reviews_against(self, study_name: str) -> dict[str, Review]:
        """By session, why people of a study were rejected or excluded; nobody else is in it."""
        with self._database.reading() as rows:
            return reviews.against(rows, study_name)

    def put_standing(self, session_id: str, n_events: int, standing: Standing) -> None:
        """Keeps where a session stands whose log was written without; see `append`."""
        with self._database.writing() as rows:
            sessions.by_id(rows, session_id)
            standings.put(rows, session_id, n_events, standing)

    def standing_lengths(self) -> dict[str, int]:
        """By session, the length of the log that its standing was written with."""
        with self._database.reading() as rows:
            return standings.lengths(rows)

    def forget_external_people(self, study_name: str, begun_before: datetime) -> int:
        """Forgets the external ids of people whose sessions began before that and have ended.

        Returns:
            Of how many.
        """
        with self._database.writing() as rows:
            n_forgotten = external.forget_of_ended(rows, study_name, begun_before)
        if n_forgotten:
            self._database.wipe()
        return n_forgotten

    def ending(self, session_id: str) -> str | None:
        """How a session has ended, such as `completed`; None while it goes on."""
        with self._database.reading() as rows:
            return sessions.ending(rows, session_id)

    def secret(self, name: str) -> bytes:
        """A secret of the server's own, 32 random bytes: made when it is first asked for, the same ever after."""
        with self._database.writing() as rows:
            return secrets.get(rows, name)

    def session(self, session_id: str) -> SessionRecord:
        """The session of this id."""
        with self._database.reading() as rows:
            return sessions.by_id(rows, session_id)

    def sessions(self, study_hash: str | None = None) -> list[SessionRecord]:
        """All sessions, or those of one study, oldest first."""
        with self._database.reading() as rows:
            return sessions.every(rows, study_hash)

    def sessions_of_study_named(self, name: str) -> list[SessionRecord]:
        """The sessions of every version of the study that has this name, oldest first."""
        with self._database.reading() as rows:
            return sessions.of_study_named(rows, name)

    def delete_session(self, session_id: str) -> Deletion:
        """Removes a person for good: log, posteriors, measures and models, and what others' models learned of them.

        Where the person has an external id, all their sessions go, also one that had become too old.

        Whoever started from such a model goes on from their study file's prior: its numbers are taken out of their
        logs, the only entries of a log that are ever changed, and the posteriors that were drawn with it are removed.

        A tombstone stays, without content; what comes late for the session is refused.

        Raises:
            SessionDeletedError: When it was deleted before.
        """
        with self._database.writing() as rows:
            deleted = deletion.delete_session(rows, session_id)
        return replace(deleted, is_wiped=self._database.wipe())

    def events(self, session_id: str) -> tuple[EventRecord, ...]:
        """A session's log, ordered by position."""
        with self._database.reading() as rows:
            return events.of_session(rows, session_id)

    def active_events(self, session_id: str, n_active: int) -> tuple[EventRecord, ...]:
        """A session's log up to its first `n_active` queries and their answers; later ones aren't read."""
        with self._database.reading() as rows:
            return events.active_of_session(rows, session_id, n_active)

    def n_answers(self, session_id: str) -> int:
        """How many answers of a session stand; one that was taken back doesn't."""
        with self._database.reading() as rows:
            return events.n_answers(rows, session_id)

    def append(
        self,
        session_id: str,
        expected_position: int,
        new_events: Sequence[NewEvent],
        posterior: PosteriorRecord | None = None,
        report: NewReport | None = None,
        goes_on_from_people: bool = False,
        ending: str | None = None,
        standing: Standing | None = None,
        excluded_because: str | None = None,
    ) -> None:
        """Appends events to a session's log, all or none.

        Args:
            session_id: The session.
            expected_position: How long the log is, as far as the caller knows.
            new_events: What happened, in order.
            posterior: The posterior that a prepared query among the events was chosen from.
            report: What the browser measured while it showed an answered query.
            goes_on_from_people: Whether the caller believes that the session still has what the people before taught.
            ending: How the session has ended with these events; None while it goes on.
            standing: Where the session stands after them.
            excluded_because: Why the study file leaves the person out of the analysis, now that they have completed.

        Raises:
            PopulationWithdrawnError: It hasn't, or the events hold what somebody taught who has been deleted since.
                Nothing was written.
            PositionTakenError: When the log isn't of the expected length, or a query in the events was
                already prepared or answered. Nothing was written.
        """
        with self._database.writing() as rows:
            events.append(rows, session_id, expected_position, new_events, posterior, goes_on_from_people)
            sessions.end(rows, session_id, ending)
            if report is not None:
                measures.add(rows, session_id, report)
            if standing is not None:
                standings.put(rows, session_id, expected_position + len(new_events), standing)
            if excluded_because is not None:
                reviews.exclude(rows, session_id, excluded_because)

    def posteriors(self, session_id: str) -> tuple[PosteriorRecord, ...]:
        """A session's posteriors, ordered by query index."""
        with self._database.reading() as rows:
            return posteriors.of_session(rows, session_id)

    def last_mean(self, session_id: str) -> NDArray[np.float64] | None:
        """The mean of a session's last posterior, shape `(d,)`, or None without any."""
        with self._database.reading() as rows:
            return posteriors.last_mean(rows, session_id)

    def last_means(self, study_hash: str) -> dict[str, NDArray[np.float64]]:
        """By session, the mean of the last posterior of each person who has completed a study, shape `(d,)`."""
        with self._database.reading() as rows:
            return posteriors.last_means(rows, study_hash)

    def put_artifact(self, key: str, kind: str, content: bytes) -> None:
        """Keeps a computed result; the first one kept under a key stays.

        Args:
            key: Hash of everything the result was computed from.
            kind: What sort of result it is, such as `test_set`.
            content: The result.
        """
        with self._database.writing() as rows:
            artifacts.put(rows, key, kind, content)

    def artifact(self, key: str) -> bytes | None:
        """The result kept under a key, or None."""
        with self._database.reading() as rows:
            return artifacts.content(rows, key)

    def put_personal_model(self, session_id: str, model: ModelRecord) -> None:
        """Keeps what was learned from a person, in the place of an earlier model of its kind.

        Raises:
            SessionDeletedError: When the person has been deleted meanwhile. Nothing was written.
        """
        with self._database.writing() as rows:
            learned.put_personal(rows, session_id, model)

    def personal_model(self, session_id: str, kind: str) -> ModelRecord | None:
        """A person's model of that kind, or None."""
        with self._database.reading() as rows:
            return learned.personal(rows, session_id, kind)

    def personal_model_key(self, session_id: str, kind: str) -> str | None:
        """The key of a person's model of that kind, or None."""
        with self._database.reading() as rows:
            return learned.personal_key(rows, session_id, kind)

    def put_shared_model(self, study_name: str, model: ModelRecord, session_ids: Iterable[str]) -> None:
        """Keeps what was learned from several people, in the place of an earlier model of its kind.

        Args:
            study_name: The study whose people it is about.
            model: What was learned.
            session_ids: Everyone it learned from; deleting one of them removes it.

        Raises:
            SessionDeletedError: When one of them has been deleted meanwhile. Nothing was written.
        """
        with self._database.writing() as rows:
            learned.put_shared(rows, study_name, model, session_ids)

    def shared_model(self, study_name: str, kind: str) -> ModelRecord | None:
        """A study's model of that kind, or None."""
        with self._database.reading() as rows:
            return learned.shared(rows, study_name, kind)

    def measures(self, session_id: str) -> tuple[MeasureRecord, ...]:
        """What browsers measured in a session, in the order it came."""
        with self._database.reading() as rows:
            return measures.of_session(rows, session_id)

    def shared_models(self, study_name: str) -> tuple[ModelRecord, ...]:
        """All models that learned from several people of a study, by kind."""
        with self._database.reading() as rows:
            return learned.every_shared(rows, study_name)

    def person(self, session_id: str) -> PersonRecord:
        """All that is kept of one person, as it is at one moment, whatever is being written meanwhile."""
        with self._database.reading() as rows:
            return people.of_session(rows, session_id)
