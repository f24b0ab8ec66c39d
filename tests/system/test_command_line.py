"""The commands as a user types them. What must be the same in every process is run in one of its own as well."""

from __future__ import annotations

import csv
import json
import socket
import sqlite3
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

import pytest
from alembic import command
from alembic.config import Config

from app.services.links import read_invitation
from app.settings import find_study
from app.store import open_store
from app.store.engine import parse_url
from app.store.migrate import MIGRATIONS, migration_transaction
from tests.support.command_line import assert_one_line_with, run, run_apart
from tests.support.published import write_person

SCRIPT = Path(__file__).with_name("quickstart.jsonl")


@pytest.fixture
def script(tmp_path: Path) -> list[str]:
    """The lines of a good script, to be spoilt."""
    return SCRIPT.read_text().splitlines()


def written(tmp_path: Path, lines: list[str]) -> str:
    path = tmp_path / "script.jsonl"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def test_a_scripted_session_gives_the_same_queries_and_posterior_to_the_last_bit() -> None:
    first, second = (go("replay", str(SCRIPT), "--json") for go in (run, run_apart))
    assert first.returncode == 0, first.stderr
    assert first.stdout == second.stdout
    summary = json.loads(first.stdout)
    assert len(summary["queries"]) == 12
    assert [row["choice"] for row in summary["queries"]] == list("abbabaababba")
    assert len(summary["posterior"]["mean"]) == 4


def test_simulated_people_are_the_same_whatever_the_database_holds_and_whoever_computes(
    tmp_path: Path,
) -> None:
    database = f"sqlite:///{tmp_path / 's.db'}"
    options = ("simulate", "--people", "2", "--seed", "9", "--database", database, "--json")
    first, second = run_apart(*options), run(*options, "--workers", "1")
    assert first.returncode == 0, first.stderr
    assert first.stdout == second.stdout
    people = [json.loads(line) for line in first.stdout.splitlines()]
    assert [person["participant"] for person in people] == ["rehearsal-9-1", "rehearsal-9-2"]
    with sqlite3.connect(tmp_path / "s.db") as rows:
        assert rows.execute("select count(*), sum(source = 'rehearsed') from sessions").fetchone() == (4, 4)


def test_simulated_people_are_written_as_one_tidy_table(tmp_path: Path) -> None:
    options = ("simulate", "--people", "2", "--seed", "9", "--drift", "0.05", "--workers", "1")
    for name, go in (("one.csv", run), ("two.csv", run_apart)):
        database = f"sqlite:///{tmp_path / name}.db"
        done = go(*options, "--database", database, "--out", str(tmp_path / name))
        assert done.returncode == 0, done.stderr
    text = (tmp_path / "one.csv").read_text()
    assert text == (tmp_path / "two.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    assert len(rows) == 2 * 12
    assert {row["participant"] for row in rows} == {"rehearsal-9-1", "rehearsal-9-2"}
    assert all(0.0 < float(row["alignment"]) <= 1.0 for row in rows)


def test_a_table_that_cannot_be_written_is_refused_before_anybody_walks(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path / 's.db'}"
    assert_one_line_with(
        run("simulate", "--database", database, "--out", "people.xlsx"), ".csv, .parquet or .jsonl"
    )
    assert not (tmp_path / "s.db").exists()


def test_a_script_with_too_few_or_too_many_answers_is_refused(tmp_path: Path, script: list[str]) -> None:
    assert_one_line_with(run("replay", written(tmp_path, script[:-1])), "expected 12 answers", "got 11")
    assert_one_line_with(
        run("replay", written(tmp_path, [*script, script[-1]])), "expected 12 answers", "got 13"
    )


@pytest.mark.parametrize(
    ("place", "line", "said"),
    [
        (3, '{"query_index": 2, "choice": "left"}', "line 4"),
        (3, "not json", "line 4"),
        (3, "[1, 2]", "line 4"),
        (3, '{"query_index": 7, "choice": "a"}', "in order"),
        (0, '{"participant": 1}', "first line"),
        (0, '{"study": "quickstert"}', "quickstert"),
    ],
)
def test_a_bad_line_in_a_script_is_named(
    tmp_path: Path, script: list[str], place: int, line: str, said: str
) -> None:
    script[place] = line
    assert_one_line_with(run("replay", written(tmp_path, script)), said)


def test_a_malformed_study_file_names_the_key(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(find_study("quickstart").text.replace("active_queries", "aktive_queries"))
    assert_one_line_with(
        run("serve", "--study", str(path)), "aktive_queries", "did you mean 'active_queries'"
    )


def test_a_busy_port_is_one_line(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as busy:
        port = str(busy.getsockname()[1])
        done = run("serve", "--port", port, "--database", f"sqlite:///{tmp_path / 's.db'}")
    assert_one_line_with(done, port, "Choose another --port")


def test_a_database_that_cannot_be_used_is_one_line(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.db"
    with sqlite3.connect(foreign) as rows:
        rows.execute("create table somebody_elses (id integer)")
    for database in (f"sqlite:///{tmp_path}", f"sqlite:///{foreign}", "nonsense"):
        assert_one_line_with(run("simulate", "--database", database))


def test_a_database_of_another_schema_version_is_refused_with_the_remedy(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path / 's.db'}"
    assert run("migrate", "--database", database).returncode == 0
    with sqlite3.connect(tmp_path / "s.db") as rows:
        rows.execute("update alembic_version set version_num = '9999'")
    assert_one_line_with(run("simulate", "--database", database), "9999")


def test_serving_the_world_needs_an_address_with_tls() -> None:
    assert_one_line_with(run("serve", "--host", "0.0.0.0"), "--public-url https://")


def test_wrong_usage_ends_with_two(tmp_path: Path) -> None:
    assert run("serve", "--no-such-option").returncode == 2
    assert run("simulate", "--people", "0").returncode == 2


def test_published_people_are_imported_once(tmp_path: Path) -> None:
    write_person(tmp_path, 3)
    options = ("import", str(tmp_path), "--database", f"sqlite:///{tmp_path / 's.db'}")
    first = run(*options, "--json")
    assert first.returncode == 0, first.stderr
    person = json.loads(first.stdout)
    assert (person["number"], person["n_active"], person["n_test"]) == (3, 6, 3)
    assert set(person["files"]) == {"train3.jld2", "test3.jld2"}
    again = run(*options)
    assert again.returncode == 0
    assert "imported before; nothing changed" in again.stdout


@pytest.mark.parametrize("damage", ["cut short", "nobody there"])
def test_a_folder_that_cannot_be_imported_is_one_line_and_makes_no_database(
    tmp_path: Path, damage: str
) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    if damage == "cut short":
        write_person(folder, 3)
        write_person(folder, 4)
        (folder / "test4.jld2").write_bytes((folder / "test4.jld2").read_bytes()[:2000])
    said = "test4.jld2" if damage == "cut short" else "train1.jld2"
    done = run("import", str(folder), "--database", f"sqlite:///{tmp_path / 's.db'}")
    assert_one_line_with(done, said)
    assert not (tmp_path / "s.db").exists()


def test_a_person_is_deleted_when_it_is_confirmed(tmp_path: Path) -> None:
    write_person(tmp_path, 3)
    database = ("--database", f"sqlite:///{tmp_path / 's.db'}")
    session_id = json.loads(run("import", str(tmp_path), "--json", *database).stdout)["session_id"]
    refused = run("delete", session_id, *database, answer="n\n")
    assert refused.returncode == 1
    assert "Delete imported person 3 of katz2021-published (9 answers) for good?" in refused.stderr
    assert run("delete", session_id, *database, answer="y\n").returncode == 0
    assert_one_line_with(run("delete", session_id, "--yes", *database), "was deleted at")
    assert_one_line_with(run("delete", "nobody", "--yes", *database), "Expected the id of a session")


def test_migrating_says_what_it_did(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path / 's.db'}"
    assert "Created the database" in run("migrate", "--database", database).stdout
    assert "nothing changed" in run("migrate", "--database", database).stdout
    old = tmp_path / "old.db"
    with migration_transaction(parse_url(f"sqlite:///{old}")) as connection:
        config = Config(attributes={"connection": connection})
        config.set_main_option("script_location", MIGRATIONS.as_posix())
        command.upgrade(config, "0001")
    done = run("migrate", "--database", f"sqlite:///{old}")
    assert "from schema 0001 to 0005. A copy of what it was is in" in done.stdout
    (copy,) = tmp_path.glob("old.db.schema-0001.*.bak")
    assert copy.name in done.stdout.replace("\n", "")


@pytest.mark.parametrize(
    "command",
    [
        "serve",
        "replay",
        "simulate",
        "export",
        "import",
        "train",
        "evaluate",
        "report",
        "delete",
        "migrate",
        "bench",
    ],
)
def test_every_command_explains_itself(command: str) -> None:
    done = run(command, "--help")
    assert done.returncode == 0
    assert len(done.stdout) > 200


def test_each_person_gets_a_link_that_holds_for_one_database(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path / 'links.db'}"
    options = ("link", "--database", database, "--base-url", "https://study.example/", "P01", "Jörg & Co")
    first, second = run_apart(*options), run(*options)
    assert first.returncode == 0, first.stderr
    assert first.stdout == second.stdout
    links = first.stdout.splitlines()
    assert len(links) == 2
    assert links[0].startswith("https://study.example/join/quickstart?id=P01&signature=")
    with open_store(database) as store:
        people = [
            read_invitation(store, "quickstart", dict(parse_qsl(urlsplit(link).query))) for link in links
        ]
    assert [(person.person.external_id, person.is_signed) for person in people if person.person] == [
        ("P01", True),
        ("Jörg & Co", True),
    ]
    other = run(*options[:1], "--database", f"sqlite:///{tmp_path / 'other.db'}", *options[3:])
    assert other.stdout != first.stdout


def test_no_link_is_made_for_what_is_no_id(tmp_path: Path) -> None:
    done = run("link", "--database", f"sqlite:///{tmp_path / 'links.db'}", "P01", "")
    assert_one_line_with(done, "1 to 200 printable characters")
