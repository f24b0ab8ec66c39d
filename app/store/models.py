"""The tables. Rows of these classes never leave the store.

A session's log is append-only. Guards stand in the tables themselves: a position is taken once; a query is prepared
once and answered once per session, and once more after each answer taken back (`revision` counts those before an
event; `prepared_query` and `answered_query` are null for other events, and nulls never clash); an external id has one
session, and one more for each time that its session had become too old.
"""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import (
    CheckConstraint,
    ForeignKey,
    ForeignKeyConstraint,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from app.store.utc import UtcDateTime

# Every constraint has a name, so that a later revision can drop it by that name on any database.
NAMING_CONVENTION = {
    "ix": "ix_%(column_0_label)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


class Base(DeclarativeBase):
    """Root of the mapped classes."""

    metadata = MetaData(naming_convention=NAMING_CONVENTION)


class StudyRow(Base):
    """A study definition's text, kept for ever under its hash.

    Where a study has conditions, each has a text of its own; they share their file's `version`.
    """

    __tablename__ = "studies"

    study_hash: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str] = mapped_column(Text, index=True)
    text: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    version: Mapped[str] = mapped_column(String(64))
    condition: Mapped[str | None] = mapped_column(String(64))


class SessionRow(Base):
    """One person's run; `ending` is how it ended, if it has."""

    __tablename__ = "sessions"
    __table_args__ = (
        UniqueConstraint("study_hash", "ordinal"),
        UniqueConstraint("import_digest"),
        CheckConstraint("ordinal >= 1", name="ordinal_from_one"),
        CheckConstraint("source IN ('joined', 'rehearsed', 'imported')", name="known_source"),
    )

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    study_hash: Mapped[str] = mapped_column(ForeignKey("studies.study_hash"))
    ordinal: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    source: Mapped[str] = mapped_column(String(16))
    import_digest: Mapped[str | None] = mapped_column(String(64))
    ending: Mapped[str | None] = mapped_column(String(16))


class SessionTokenRow(Base):
    """One of the secrets that open a session, by its hash alone; an imported session has none.

    `code_hash` is of the code that gets the session another token, for whoever has only the code.
    """

    __tablename__ = "session_tokens"
    __table_args__ = (UniqueConstraint("code_hash"),)

    token_hash: Mapped[str] = mapped_column(String(64), primary_key=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), index=True)
    code_hash: Mapped[str | None] = mapped_column(String(64))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class ExternalPersonRow(Base):
    """Who somebody is to the service or experimenter that sent them, whatever version of the study they met.

    The newest attempt is the one that counts; earlier ones have ended because they had become too old.
    """

    __tablename__ = "external_people"
    __table_args__ = (UniqueConstraint("session_id"),)

    study_name: Mapped[str] = mapped_column(String(255), primary_key=True)
    external_id: Mapped[str] = mapped_column(String(200), primary_key=True)
    attempt: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"))
    other_ids: Mapped[str] = mapped_column(Text)


class EventRow(Base):
    """One entry of a session's log."""

    __tablename__ = "events"
    __table_args__ = (
        UniqueConstraint("session_id", "answered_query", "revision"),
        UniqueConstraint("session_id", "prepared_query", "revision"),
        CheckConstraint("position >= 0", name="position_from_zero"),
    )

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(64))
    payload: Mapped[str] = mapped_column(Text)
    at: Mapped[datetime] = mapped_column(UtcDateTime)
    answered_query: Mapped[int | None]
    prepared_query: Mapped[int | None]
    taken_back_query: Mapped[int | None]
    revision: Mapped[int]


class PosteriorRow(Base):
    """The posterior a query was chosen from; see `codec` for the blobs."""

    __tablename__ = "posteriors"

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    query_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    n_samples: Mapped[int]
    n_dims: Mapped[int]
    mean: Mapped[bytes] = mapped_column(LargeBinary)
    samples: Mapped[bytes] = mapped_column(LargeBinary)
    parameters: Mapped[bytes | None] = mapped_column(LargeBinary)
    summary: Mapped[str] = mapped_column(Text)


class ArtifactRow(Base):
    """A computed result named by the hash of what it was computed from."""

    __tablename__ = "artifacts"

    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    kind: Mapped[str] = mapped_column(String(64))
    content: Mapped[bytes] = mapped_column(LargeBinary)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class BrowserMeasureRow(Base):
    """What a browser measured; kept apart from the log, which holds only what the study depends on."""

    __tablename__ = "browser_measures"

    id: Mapped[int] = mapped_column(primary_key=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), index=True)
    query_index: Mapped[int]
    measures: Mapped[str] = mapped_column(Text)
    at: Mapped[datetime] = mapped_column(UtcDateTime)


class PersonalModelRow(Base):
    """What was learned from one person's answers; a later model of its kind takes its place."""

    __tablename__ = "personal_models"

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    kind: Mapped[str] = mapped_column(String(64), primary_key=True)
    key: Mapped[str] = mapped_column(String(255))
    content: Mapped[bytes] = mapped_column(LargeBinary)
    lineage: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class SharedModelRow(Base):
    """What was learned from several people of a study."""

    __tablename__ = "shared_models"

    study_name: Mapped[str] = mapped_column(String(255), primary_key=True)
    kind: Mapped[str] = mapped_column(String(64), primary_key=True)
    key: Mapped[str] = mapped_column(String(255))
    content: Mapped[bytes] = mapped_column(LargeBinary)
    lineage: Mapped[str] = mapped_column(Text)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class SharedModelPersonRow(Base):
    """A session that a shared model learned from.

    Its key to the session cascades nothing: the database itself refuses to let go of a person while a model remembers
    them.
    """

    __tablename__ = "shared_model_people"
    __table_args__ = (
        ForeignKeyConstraint(
            ["study_name", "kind"], ["shared_models.study_name", "shared_models.kind"], ondelete="CASCADE"
        ),
    )

    study_name: Mapped[str] = mapped_column(String(255), primary_key=True)
    kind: Mapped[str] = mapped_column(String(64), primary_key=True)
    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id"), primary_key=True, index=True)


class SecretRow(Base):
    """A secret of the server's own, made when it was first needed."""

    __tablename__ = "secrets"

    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    value: Mapped[bytes] = mapped_column(LargeBinary)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class ExperimenterRow(Base):
    """Somebody who may use the desk."""

    __tablename__ = "experimenters"
    __table_args__ = (CheckConstraint("role IN ('owner', 'assistant', 'viewer')", name="known_role"),)

    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    password_hash: Mapped[str] = mapped_column(Text)
    role: Mapped[str] = mapped_column(String(16))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)


class DeskSessionRow(Base):
    """A browser in which an experimenter is logged in, by the hash of its secret."""

    __tablename__ = "desk_sessions"

    token_hash: Mapped[str] = mapped_column(String(64), primary_key=True)
    experimenter: Mapped[str] = mapped_column(ForeignKey("experimenters.name", ondelete="CASCADE"))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    last_seen_at: Mapped[datetime] = mapped_column(UtcDateTime)


class ApiTokenRow(Base):
    """A program that an experimenter lets in, by the hash of its secret."""

    __tablename__ = "api_tokens"
    __table_args__ = (
        UniqueConstraint("token_hash"),
        CheckConstraint("role IN ('owner', 'assistant', 'viewer')", name="known_role"),
    )

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    token_hash: Mapped[str] = mapped_column(String(64))
    experimenter: Mapped[str] = mapped_column(ForeignKey("experimenters.name", ondelete="CASCADE"))
    label: Mapped[str] = mapped_column(String(100))
    role: Mapped[str] = mapped_column(String(16))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    revoked_at: Mapped[datetime | None] = mapped_column(UtcDateTime)


class ReviewRow(Base):
    """What experimenters have decided about a session; `revision` counts its changes."""

    __tablename__ = "reviews"
    __table_args__ = (CheckConstraint("verdict IN ('rejected', 'excluded')", name="known_verdict"),)

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    verdict: Mapped[str | None] = mapped_column(String(16))
    reason: Mapped[str] = mapped_column(Text)
    note: Mapped[str] = mapped_column(Text)
    revision: Mapped[int]
    changed_by: Mapped[str] = mapped_column(String(64))
    changed_at: Mapped[datetime] = mapped_column(UtcDateTime)


class AuditRow(Base):
    """Something that an experimenter did; never changed, and it outlives them and whom it was about."""

    __tablename__ = "audit"

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime] = mapped_column(UtcDateTime)
    who: Mapped[str] = mapped_column(String(64))
    action: Mapped[str] = mapped_column(String(64))
    about: Mapped[str | None] = mapped_column(String(255))
    detail: Mapped[str] = mapped_column(Text)


class StandingRow(Base):
    """Where a session stands: follows from its log, and is written with it, so that nobody reads whole logs to see."""

    __tablename__ = "standings"

    session_id: Mapped[str] = mapped_column(ForeignKey("sessions.id", ondelete="CASCADE"), primary_key=True)
    n_events: Mapped[int]
    last_at: Mapped[datetime] = mapped_column(UtcDateTime)
    step: Mapped[int]
    n_answers: Mapped[int]
    test_answers: Mapped[str] = mapped_column(Text)
    n_repeats: Mapped[int]
    n_repeats_agreed: Mapped[int]
    n_checks: Mapped[int]
    n_checks_passed: Mapped[int]
    n_sided: Mapped[int]
    n_first: Mapped[int]
    response_ms: Mapped[int]
    n_waits: Mapped[int]
    waited_ms: Mapped[int]
    focus_losses: Mapped[int]
    r_hat: Mapped[float | None]
    ess: Mapped[float | None]
    mean: Mapped[bytes | None] = mapped_column(LargeBinary)


class TombstoneRow(Base):
    """All that is left of a deleted session."""

    __tablename__ = "tombstones"

    session_id: Mapped[str] = mapped_column(String(32), primary_key=True)
    deleted_at: Mapped[datetime] = mapped_column(UtcDateTime)


def table_of(rows: type[Base]) -> Table:
    """The table of a mapped class, for inserts that people wait for: they need no objects."""
    table = rows.__table__
    assert isinstance(table, Table)
    return table
