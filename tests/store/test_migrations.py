"""The revisions make the schema that the models describe, and data survives them."""

import ast
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import inspect

from app.store import StoreError, open_store
from app.store.engine import parse_url
from app.store.migrate import MIGRATIONS, migration_transaction, upgrade
from app.store.models import Base
from app.store.sqlite import check_foreign_keys

ROOT = Path(__file__).parents[2]


def test_the_schema_from_the_revisions_equals_the_models(store, database_url):
    with migration_transaction(parse_url(database_url)) as connection:
        context = MigrationContext.configure(connection, opts={"compare_server_default": True})
        assert compare_metadata(context, Base.metadata) == []


def test_checks_and_deletion_rules_from_the_revisions_equal_the_models(store, database_url):
    # Alembic's comparison doesn't look at these.
    with migration_transaction(parse_url(database_url)) as connection:
        found = inspect(connection)
        for table in Base.metadata.sorted_tables:
            checks = {check["name"] for check in found.get_check_constraints(table.name)}
            assert checks == {c.name for c in table.constraints if type(c).__name__ == "CheckConstraint"}
            rules = {key["options"].get("ondelete") for key in found.get_foreign_keys(table.name)}
            assert rules == {key.ondelete for key in table.foreign_keys}


def test_revisions_form_one_line():
    script = ScriptDirectory(str(MIGRATIONS))
    assert len(script.get_heads()) == 1
    assert len(script.get_bases()) == 1


@pytest.mark.parametrize("path", sorted((MIGRATIONS / "versions").glob("*.py")), ids=lambda path: path.stem)
def test_a_revision_imports_neither_package(path):
    imports = [
        name
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in [getattr(node, "module", None), *(alias.name for alias in node.names)]
        if name
    ]
    assert not [name for name in imports if name.split(".")[0] in ("app", "study_core")]


def test_migrating_a_current_database_keeps_its_data(database_url):
    with open_store(database_url) as store:
        store.put_study("hash", "name", "text")
    upgrade(database_url)
    with open_store(database_url) as store:
        assert store.study_text("hash") == "text"


def test_a_dangling_row_is_found(store, database_url):
    with migration_transaction(parse_url(database_url)) as connection:
        connection.exec_driver_sql(
            "INSERT INTO browser_measures (session_id, query_index, measures, at) VALUES ('nobody', 0, '{}', '')"
        )
        with pytest.raises(StoreError, match="browser_measures"):
            check_foreign_keys(connection)
        connection.rollback()


def test_alembic_finds_its_settings_and_nothing_to_add(database_url, monkeypatch):
    monkeypatch.setenv("PREFSTUDY_DATABASE", database_url)
    monkeypatch.syspath_prepend(str(ROOT))
    open_store(database_url).close()
    config = Config(toml_file=str(ROOT / "pyproject.toml"))
    command.check(config)


def test_a_new_revision_is_written_without_our_column_types(database_url, monkeypatch, tmp_path):
    monkeypatch.setenv("PREFSTUDY_DATABASE", database_url)
    config = Config()
    config.set_main_option("script_location", MIGRATIONS.as_posix())
    config.set_main_option("path_separator", "newline")
    config.set_main_option("version_locations", str(tmp_path))
    config.set_main_option("file_template", "written")

    command.revision(config, "everything anew", autogenerate=True)

    text = (tmp_path / "written.py").read_text()
    assert "sa.DateTime(timezone=True)" in text
    assert "UtcDateTime" not in text
    assert "app." not in text
    compile(text, "written.py", "exec")
