"""Commands that move, delete and convert what was recorded."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from app.cli.learning import learn_populations
from app.cli.options import DatabaseOption
from app.settings import DEFAULT_DATABASE
from app.terminal import JsonOption, console, counter, new_progress


def import_(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of the published study's JLD2 files.")
    ],
    database: DatabaseOption = DEFAULT_DATABASE,
    json_: JsonOption = False,
) -> None:
    """Take the published study's people into a database, as finished sessions marked as imported.

    Any subset of the people will do. All files are read before anything is stored; somebody who is there already stays
    as they are.
    """
    from app.services.published import import_person, read_people
    from app.store import open_store

    with new_progress() as progress:
        people = read_people(directory, counter(progress, "people"))
    with open_store(database) as store:
        for person in people:
            done = import_person(store, person)
            if json_:
                print(json.dumps(asdict(done)))
                continue
            became = (
                f"session {done.session_id}" if done.session_id else "was imported before; nothing changed"
            )
            answers = f"{done.n_active} active and {done.n_test} test answers"
            print(f"person {done.number:2d}: {answers}; {became}")


def delete(
    person_id: Annotated[str, typer.Argument(help="The person's id, as `export` writes it.")],
    database: DatabaseOption = DEFAULT_DATABASE,
    yes: Annotated[bool, typer.Option("--yes", help="Don't ask.")] = False,
) -> None:
    """Delete a person for good: answers, posteriors, measures, their models, and every model that learned from them.

    What the others have in common is learned again. Their id and the time of deletion stay.
    Copies that `migrate` or you have made are not touched.
    """
    from app.services.desk_accounts import COMMAND_LINE
    from app.services.evaluation import number
    from app.services.people import person
    from app.store import open_existing_store

    with open_existing_store(database) as store:
        record = store.session(person_id)
        name = store.study_name(record.study_hash)
        its_number = number(person(store, record))
        who = f"{record.source} person {its_number} of {name} ({store.n_answers(person_id)} answers)"
        if not yes:
            typer.confirm(f"Delete {who} for good?", abort=True, err=True)
        done = store.delete_session(person_id)
        store.desk.record(COMMAND_LINE, "person_deleted", person_id, {"answers": done.n_answers})
        models = f"{done.n_personal_models} personal and {done.n_shared_models} shared models"
        print(f"Deleted {who}, with {models}.")
        learn_populations(store, name)
    if not done.is_wiped:
        console.print(
            "[yellow]The database's files may still hold traces:[/] another program reads them or keeps them. "
            "Stop whoever reads a SQLite file, then run VACUUM on it.",
            highlight=False,
        )


def backup(
    file: Annotated[Path, typer.Argument(help="A new file.")],
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Copy a database to a file, also while it is served, and read the copy back.

    A copy keeps whoever is deleted later: delete it as well, or restore it, which deletes them again.
    """
    from app.store.backup import back_up

    contents = back_up(database, file)
    print(f"Wrote {file}: {contents.n_sessions} people, {contents.n_events} events; read back and whole.")


def restore(
    file: Annotated[Path, typer.Argument(help="What `backup` has written.")],
    database: DatabaseOption = DEFAULT_DATABASE,
) -> None:
    """Put a backup in the place of a database; nothing may be serving it meanwhile.

    The backup is read in full first, and a copy of what was there is kept. Whoever was deleted since stays deleted;
    the desk's accounts, tokens and audit stay as they are.
    """
    from app.services.desk_accounts import COMMAND_LINE
    from app.store import open_existing_store
    from app.store.backup import restore as restore_backup

    done = restore_backup(database, file)
    with open_existing_store(database) as store:
        detail = {"file": file.name, "n_sessions": done.contents.n_sessions, "n_deleted": done.n_deleted}
        store.desk.record(COMMAND_LINE, "restored", None, detail)
    print(f"Restored {done.contents.n_sessions} people, {done.contents.n_events} events.")
    if done.n_deleted:
        print(f"{done.n_deleted} of the backup had been deleted since, and are so again.")
    if done.before is not None:
        print(f"A copy of what was there is in {done.before}.")


def forget(database: DatabaseOption = DEFAULT_DATABASE) -> None:
    """Forget the ids by which others know people, where their study says that their time is over.

    That is `forget_ids_after_days` in the section [data] of a study file. `serve` does the same every day.
    """
    from app.services.retention import forget_ids
    from app.store import open_existing_store

    with open_existing_store(database) as store:
        forgotten = forget_ids(store)
    for name, n_people in forgotten.items():
        print(f"Forgot the ids of {n_people} people of {name}.")
    if not forgotten:
        print("There was nothing to forget.")


def migrate(database: DatabaseOption = DEFAULT_DATABASE) -> None:
    """Bring a database to this version's schema; nothing may be serving it meanwhile.

    A SQLite file is copied first, next to it.
    """
    from app.store.migrate import upgrade

    done = upgrade(database)
    if done.before == done.after:
        print(f"The database has schema {done.after} already; nothing changed.")
    elif done.before is None:
        print(f"Created the database with schema {done.after}.")
    else:
        copy = f" A copy of what it was is in {done.backup}." if done.backup else ""
        print(f"Upgraded the database from schema {done.before} to {done.after}.{copy}")
