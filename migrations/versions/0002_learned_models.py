"""Where sessions come from, models that learned from people, and what is left of a deleted session."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    _say_where_sessions_come_from()
    op.create_table(
        "tombstones",
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("deleted_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("session_id", name=op.f("pk_tombstones")),
    )
    op.create_table(
        "personal_models",
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("kind", sa.String(length=64), nullable=False),
        sa.Column("key", sa.String(length=255), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("lineage", sa.Text(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["session_id"],
            ["sessions.id"],
            name=op.f("fk_personal_models_session_id_sessions"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("session_id", "kind", name=op.f("pk_personal_models")),
    )
    op.create_table(
        "shared_models",
        sa.Column("study_name", sa.String(length=255), nullable=False),
        sa.Column("kind", sa.String(length=64), nullable=False),
        sa.Column("key", sa.String(length=255), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("lineage", sa.Text(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("study_name", "kind", name=op.f("pk_shared_models")),
    )
    op.create_table(
        "shared_model_people",
        sa.Column("study_name", sa.String(length=255), nullable=False),
        sa.Column("kind", sa.String(length=64), nullable=False),
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.ForeignKeyConstraint(
            ["session_id"], ["sessions.id"], name=op.f("fk_shared_model_people_session_id_sessions")
        ),
        sa.ForeignKeyConstraint(
            ["study_name", "kind"],
            ["shared_models.study_name", "shared_models.kind"],
            name=op.f("fk_shared_model_people_study_name_shared_models"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("study_name", "kind", "session_id", name=op.f("pk_shared_model_people")),
    )
    op.create_index(
        op.f("ix_shared_model_people_session_id"), "shared_model_people", ["session_id"], unique=False
    )


def _say_where_sessions_come_from() -> None:
    with op.batch_alter_table("sessions") as sessions:
        sessions.add_column(sa.Column("source", sa.String(length=16), nullable=True))
        sessions.add_column(sa.Column("import_digest", sa.String(length=64), nullable=True))
    op.execute("UPDATE sessions SET source = CASE WHEN is_rehearsed THEN 'rehearsed' ELSE 'joined' END")
    with op.batch_alter_table("sessions") as sessions:
        sessions.alter_column("source", existing_type=sa.String(length=16), nullable=False)
        # No link opens an imported session.
        sessions.alter_column("token_hash", existing_type=sa.String(length=64), nullable=True)
        sessions.drop_column("is_rehearsed")
        sessions.create_unique_constraint(op.f("uq_sessions_import_digest"), ["import_digest"])
        sessions.create_check_constraint(
            op.f("ck_sessions_known_source"), "source IN ('joined', 'rehearsed', 'imported')"
        )
