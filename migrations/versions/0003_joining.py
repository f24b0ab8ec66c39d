"""Several secrets a session, external ids, endings, and answers that are taken back."""

from __future__ import annotations

import tomllib

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    _move_tokens()
    _say_who_has_finished()
    _number_revisions()
    op.create_table(
        "external_people",
        sa.Column("study_name", sa.String(length=255), nullable=False),
        sa.Column("external_id", sa.String(length=200), nullable=False),
        sa.Column("attempt", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("other_ids", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["session_id"],
            ["sessions.id"],
            name=op.f("fk_external_people_session_id_sessions"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("study_name", "external_id", "attempt", name=op.f("pk_external_people")),
        sa.UniqueConstraint("session_id", name=op.f("uq_external_people_session_id")),
    )
    op.create_table(
        "secrets",
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("value", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_secrets")),
    )


def _move_tokens() -> None:
    op.create_table(
        "session_tokens",
        sa.Column("token_hash", sa.String(length=64), nullable=False),
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("code_hash", sa.String(length=64), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["session_id"],
            ["sessions.id"],
            name=op.f("fk_session_tokens_session_id_sessions"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("token_hash", name=op.f("pk_session_tokens")),
        sa.UniqueConstraint("code_hash", name=op.f("uq_session_tokens_code_hash")),
    )
    op.create_index(op.f("ix_session_tokens_session_id"), "session_tokens", ["session_id"], unique=False)
    op.execute(
        "INSERT INTO session_tokens (token_hash, session_id, created_at) "
        "SELECT token_hash, id, created_at FROM sessions WHERE token_hash IS NOT NULL"
    )
    with op.batch_alter_table("sessions") as sessions:
        sessions.drop_constraint(op.f("uq_sessions_token_hash"), type_="unique")
        sessions.drop_column("token_hash")
        sessions.add_column(sa.Column("ending", sa.String(length=16), nullable=True))


def _say_who_has_finished() -> None:
    """Until now a session ended with its last answer, and in no other way."""
    connection = op.get_bind()
    finish = sa.text(
        "UPDATE sessions SET ending = 'completed' WHERE study_hash = :study_hash AND :n_queries = "
        "(SELECT count(answered_query) FROM events WHERE events.session_id = sessions.id)"
    )
    for study_hash, text in connection.execute(sa.text("SELECT study_hash, text FROM studies")).all():
        protocol = tomllib.loads(text)["protocol"]
        n_queries = protocol["active_queries"] + protocol["test_queries"]
        connection.execute(finish, {"study_hash": study_hash, "n_queries": n_queries})


def _number_revisions() -> None:
    with op.batch_alter_table("events") as events:
        events.add_column(sa.Column("taken_back_query", sa.Integer(), nullable=True))
        events.add_column(sa.Column("revision", sa.Integer(), nullable=True))
    op.execute("UPDATE events SET revision = 0")
    with op.batch_alter_table("events") as events:
        events.alter_column("revision", existing_type=sa.Integer(), nullable=False)
        for column in ("answered_query", "prepared_query"):
            events.drop_constraint(op.f(f"uq_events_session_id_{column}"), type_="unique")
            events.create_unique_constraint(
                op.f(f"uq_events_session_id_{column}_revision"), ["session_id", column, "revision"]
            )
