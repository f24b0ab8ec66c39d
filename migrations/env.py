"""How Alembic runs a revision: on the connection it is handed, or on PREFSTUDY_DATABASE."""

from __future__ import annotations

import os
from typing import Any, Literal

from alembic import context
from alembic.autogenerate.api import AutogenContext
from sqlalchemy import Connection

from app.store.engine import parse_url
from app.store.migrate import migration_transaction
from app.store.models import Base
from app.store.utc import UtcDateTime


def render_item(kind: str, item: Any, _context: AutogenContext) -> str | Literal[False]:
    """Writes our own column type into a new revision as the plain one, since revisions import no package."""
    if kind == "type" and isinstance(item, UtcDateTime):
        return "sa.DateTime(timezone=True)"
    return False


def run(connection: Connection) -> None:
    """Runs the revisions; on SQLite a changed table is rebuilt, which Alembic calls a batch."""
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        render_item=render_item,
        render_as_batch=connection.dialect.name == "sqlite",
    )
    with context.begin_transaction():
        context.run_migrations()


def main() -> None:
    """Finds the connection."""
    handed_over = context.config.attributes.get("connection")
    if handed_over is not None:
        run(handed_over)
        return
    if context.is_offline_mode():
        raise SystemExit("Revisions need a database to run on; leave out --sql.")
    with migration_transaction(parse_url(os.environ.get("PREFSTUDY_DATABASE", "sqlite:///study.db"))) as own:
        run(own)


main()
