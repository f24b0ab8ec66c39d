"""Experimenters and what they do; conditions; where everybody stands."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    _say_which_version_a_study_is()
    _number_people_through_all_versions()
    _let_experimenters_in()
    _keep_what_they_do()
    _say_where_everybody_stands()


def _say_which_version_a_study_is() -> None:
    """Until now every study had one arm: its own text."""
    with op.batch_alter_table("studies") as studies:
        studies.add_column(sa.Column("version", sa.String(length=64), nullable=True))
        studies.add_column(sa.Column("condition", sa.String(length=64), nullable=True))
    op.execute("UPDATE studies SET version = study_hash")
    with op.batch_alter_table("studies") as studies:
        studies.alter_column("version", existing_type=sa.String(length=64), nullable=False)


def _number_people_through_all_versions() -> None:
    """Numbers that were given stay; only new ones go on through all versions of a study."""
    op.create_index(op.f("ix_studies_name"), "studies", ["name"], unique=False)


def _let_experimenters_in() -> None:
    op.create_table(
        "experimenters",
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("password_hash", sa.Text(), nullable=False),
        sa.Column("role", sa.String(length=16), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(
            "role IN ('owner', 'assistant', 'viewer')", name=op.f("ck_experimenters_known_role")
        ),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_experimenters")),
    )
    op.create_table(
        "desk_sessions",
        sa.Column("token_hash", sa.String(length=64), nullable=False),
        sa.Column("experimenter", sa.String(length=64), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("last_seen_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["experimenter"],
            ["experimenters.name"],
            name=op.f("fk_desk_sessions_experimenter_experimenters"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("token_hash", name=op.f("pk_desk_sessions")),
    )
    op.create_table(
        "api_tokens",
        sa.Column("id", sa.String(length=16), nullable=False),
        sa.Column("token_hash", sa.String(length=64), nullable=False),
        sa.Column("experimenter", sa.String(length=64), nullable=False),
        sa.Column("label", sa.String(length=100), nullable=False),
        sa.Column("role", sa.String(length=16), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("revoked_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint("role IN ('owner', 'assistant', 'viewer')", name=op.f("ck_api_tokens_known_role")),
        sa.ForeignKeyConstraint(
            ["experimenter"],
            ["experimenters.name"],
            name=op.f("fk_api_tokens_experimenter_experimenters"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_api_tokens")),
        sa.UniqueConstraint("token_hash", name=op.f("uq_api_tokens_token_hash")),
    )


def _keep_what_they_do() -> None:
    op.create_table(
        "reviews",
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("verdict", sa.String(length=16), nullable=True),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("changed_by", sa.String(length=64), nullable=False),
        sa.Column("changed_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("verdict IN ('rejected', 'excluded')", name=op.f("ck_reviews_known_verdict")),
        sa.ForeignKeyConstraint(
            ["session_id"],
            ["sessions.id"],
            name=op.f("fk_reviews_session_id_sessions"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("session_id", name=op.f("pk_reviews")),
    )
    op.create_table(
        "audit",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("who", sa.String(length=64), nullable=False),
        sa.Column("action", sa.String(length=64), nullable=False),
        sa.Column("about", sa.String(length=255), nullable=True),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit")),
    )


def _say_where_everybody_stands() -> None:
    op.create_table(
        "standings",
        sa.Column("session_id", sa.String(length=32), nullable=False),
        sa.Column("n_events", sa.Integer(), nullable=False),
        sa.Column("last_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("step", sa.Integer(), nullable=False),
        sa.Column("n_answers", sa.Integer(), nullable=False),
        sa.Column("test_answers", sa.Text(), nullable=False),
        sa.Column("n_repeats", sa.Integer(), nullable=False),
        sa.Column("n_repeats_agreed", sa.Integer(), nullable=False),
        sa.Column("n_checks", sa.Integer(), nullable=False),
        sa.Column("n_checks_passed", sa.Integer(), nullable=False),
        sa.Column("n_sided", sa.Integer(), nullable=False),
        sa.Column("n_first", sa.Integer(), nullable=False),
        sa.Column("response_ms", sa.Integer(), nullable=False),
        sa.Column("n_waits", sa.Integer(), nullable=False),
        sa.Column("waited_ms", sa.Integer(), nullable=False),
        sa.Column("focus_losses", sa.Integer(), nullable=False),
        sa.Column("r_hat", sa.Double(), nullable=True),
        sa.Column("ess", sa.Double(), nullable=True),
        sa.Column("mean", sa.LargeBinary(), nullable=True),
        sa.ForeignKeyConstraint(
            ["session_id"],
            ["sessions.id"],
            name=op.f("fk_standings_session_id_sessions"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("session_id", name=op.f("pk_standings")),
    )
