"""The revisions make the schema that the models describe, and data survives them."""

import ast
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import inspect

from app.store import NewEvent, PositionTakenError, Source, StoreError, open_store
from app.store.engine import parse_url
from app.store.migrate import MIGRATIONS, Upgrade, head_version, migration_transaction, upgrade
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


STUDY_TEXT = "[protocol]\nactive_queries = 1\ntest_queries = 1\n"


@pytest.fixture
def old_url(database_url):
    """A database of the first schema, with a participant, a rehearsed person and what they left."""
    at = "2026-01-02 03:04:05.000000"
    with migration_transaction(parse_url(database_url)) as connection:
        config = Config(attributes={"connection": connection})
        config.set_main_option("script_location", MIGRATIONS.as_posix())
        command.upgrade(config, "0001")
        run = connection.exec_driver_sql
        run("INSERT INTO studies VALUES ('hash', 'mine', ?, ?)", (STUDY_TEXT, at))
        for number, is_rehearsed in ((1, 0), (2, 1)):
            name = f"person-{number}"
            columns = "id, study_hash, ordinal, token_hash, is_rehearsed, created_at"
            run(
                f"INSERT INTO sessions ({columns}) VALUES (?, 'hash', ?, ?, ?, ?)",
                (name, number, f"token-{number}", is_rehearsed, at),
            )
            run("INSERT INTO events VALUES (?, 0, 'session_begun', '{}', ?, NULL, NULL)", (name, at))
            run(
                "INSERT INTO browser_measures (session_id, query_index, measures, at) VALUES (?, 0, '{}', ?)",
                (name, at),
            )
    return database_url


def test_people_of_the_first_schema_keep_all_they_had_and_where_they_came_from(old_url):
    with pytest.raises(StoreError, match="run `prefstudy migrate`, which keeps a copy"):
        open_store(old_url)
    done = upgrade(old_url)
    assert (done.before, done.after) == ("0001", head_version())
    with open_store(old_url) as store:
        assert [record.source for record in store.sessions()] == [Source.JOINED, Source.REHEARSED]
        assert [record.ordinal for record in store.sessions("hash")] == [1, 2]
        assert store.session_by_token("token-2").id == "person-2"
        assert [len(store.events(f"person-{number}")) for number in (1, 2)] == [1, 1]
        assert store.create_session("hash", "token-3", Source.JOINED).ordinal == 3


def test_a_person_of_the_first_schema_can_be_deleted_once_migrated(old_url):
    upgrade(old_url)
    with open_store(old_url) as store:
        store.delete_session("person-1")
        assert [record.id for record in store.sessions()] == ["person-2"]
    with migration_transaction(parse_url(old_url)) as connection:
        left = connection.exec_driver_sql("SELECT DISTINCT session_id FROM browser_measures").scalars().all()
        assert left == ["person-2"]
        check_foreign_keys(connection)


def test_the_copy_that_a_migration_leaves_is_the_database_as_it_was(old_url):
    done = upgrade(old_url)
    assert done.backup.parent == Path(old_url.removeprefix("sqlite:///")).parent
    assert done.backup.name.startswith("study.db.schema-0001.")
    with closing(sqlite3.connect(done.backup)) as rows:
        assert rows.execute("SELECT version_num FROM alembic_version").fetchall() == [("0001",)]
        assert rows.execute("SELECT id, is_rehearsed FROM sessions").fetchall() == [
            ("person-1", 0),
            ("person-2", 1),
        ]


def test_a_migration_that_changes_nothing_leaves_no_copy(database_url, tmp_path):
    assert upgrade(database_url) == Upgrade(None, head_version(), None)
    assert upgrade(database_url) == Upgrade(head_version(), head_version(), None)
    assert list(tmp_path.glob("*.bak")) == []


def test_a_migration_that_fails_changes_nothing(old_url, monkeypatch):
    def fail(connection):
        raise StoreError("a row points to nothing")

    monkeypatch.setattr("app.store.sqlite.check_foreign_keys", fail)
    with pytest.raises(StoreError, match="points to nothing"):
        upgrade(old_url)
    monkeypatch.undo()
    assert upgrade(old_url).before == "0001"


@pytest.fixture
def joined_url(old_url):
    """A database of the second schema: somebody half-way, somebody who has finished and somebody imported."""
    at = "2026-01-02 03:04:05.000000"
    with migration_transaction(parse_url(old_url)) as connection:
        config = Config(attributes={"connection": connection})
        config.set_main_option("script_location", MIGRATIONS.as_posix())
        command.upgrade(config, "0002")
        run = connection.exec_driver_sql
        run(
            "INSERT INTO sessions (id, study_hash, ordinal, created_at, source, import_digest) "
            "VALUES ('person-3', 'hash', 3, ?, 'imported', 'digest')",
            (at,),
        )
        for name, n_answers in (("person-1", 1), ("person-2", 2), ("person-3", 2)):
            for query_index in range(n_answers):
                for column in ("prepared_query", "answered_query"):
                    position = 1 + 2 * query_index + (column == "answered_query")
                    run(
                        f"INSERT INTO events (session_id, position, kind, payload, at, {column}) "
                        "VALUES (?, ?, 'something', '{}', ?, ?)",
                        (name, position, at, query_index),
                    )
    return old_url


def test_links_of_the_second_schema_still_open_their_sessions(joined_url):
    assert upgrade(joined_url).before == "0002"
    with open_store(joined_url) as store:
        assert [store.session_by_token(f"token-{n}").id for n in (1, 2)] == ["person-1", "person-2"]
        store.add_token("person-1", "another-device")
        assert store.session_by_token("another-device").id == "person-1"


def test_who_had_answered_everything_under_the_second_schema_has_completed(joined_url):
    upgrade(joined_url)
    with open_store(joined_url) as store:
        assert [store.ending(f"person-{n}") for n in (1, 2, 3)] == [None, "completed", "completed"]
        assert [store.n_answers(f"person-{n}") for n in (1, 2, 3)] == [1, 2, 2]


def test_an_answer_of_the_second_schema_can_be_taken_back_and_only_then_given_again(joined_url):
    upgrade(joined_url)
    answer = NewEvent("answer_given", {"query_index": 0})
    with open_store(joined_url) as store:
        with pytest.raises(PositionTakenError):
            store.append("person-1", 3, [answer])
        store.append("person-1", 3, [NewEvent("answer_taken_back", {"query_index": 0}), answer])
        assert store.n_answers("person-1") == 1
