"""The response parameters of every posterior sample, where they differ: what a query's score is made of."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("posteriors", sa.Column("parameters", sa.LargeBinary(), nullable=True))
