"""Nobody can be recognised by an id in an export with pseudonyms, and it still replays."""

from __future__ import annotations

import csv
import stat
from datetime import UTC, datetime
from pathlib import Path

import pytest

from app.services.export import Export, ExportError, ExportOptions, export, open_export
from app.services.export.layout import FORMS
from app.store import ExternalPerson, ModelRecord, NewEvent, NewReport, Source, Store, open_store
from tests.services.export.people import FULL_PATH, QUICKSTART
from tests.support.exports import replayed

PID = "5f1a-Prolific-PID"


def pseudonymous(store: Store, folder: Path, form: str = "csv", keeps_times: bool = False) -> Export:
    options = ExportOptions(
        form,  # type: ignore[arg-type]
        "all",
        has_pseudonyms=True,
        key_file=folder.with_name(f"{folder.name}-key.csv"),
        keeps_times=keeps_times,
    )
    export(store, folder, options)
    return open_export(folder)


@pytest.fixture
def told(store: Store) -> list[str]:
    """Two people, of whom one writes who they are wherever somebody can; everything that would name them."""
    for study in (QUICKSTART, FULL_PATH):
        store.put_study(study.hash, study.name, study.text)
    other = store.create_session(QUICKSTART.hash, "t1", Source.JOINED)
    person = ExternalPerson("full-path", PID, {"STUDY_ID": "study-77", "SESSION_ID": "session-88"})
    who = store.create_session(FULL_PATH.hash, "t2", Source.JOINED, None, person)
    answers = {"accept": [f"I am {PID.upper()}, session {who.id}"]}
    events = [
        NewEvent("session_begun", {"participant": 1}),
        NewEvent("step_taken", {"step": 0, "outcome": "done", "content": {"answers": answers}}),
        NewEvent(
            "population_adopted",
            {"query_index": 0, "key": "0" * 64, "learned_from": [other.id, "f" * 32], "population": None},
        ),
    ]
    report = NewReport(0, {"referrer": f"https://example.org/?PROLIFIC_PID={PID}&s={who.id}&p=session-88"})
    store.append(who.id, 0, events, report=report)
    store.put_personal_model(who.id, ModelRecord("own", "k", b"{}", {"sessions": [who.id]}))
    store.put_shared_model(
        "full-path", ModelRecord("of-all", "k", b"{}", {"sessions": [who.id, other.id]}), [who.id, other.id]
    )
    return [other.id, who.id, "f" * 32, PID, "study-77", "session-88"]


@pytest.mark.parametrize("form", FORMS)
def test_no_id_is_left_in_any_byte(store: Store, told: list[str], tmp_path: Path, form: str) -> None:
    exported = pseudonymous(store, tmp_path / "out", form)
    plain = tmp_path / "plain"
    export(store, plain, ExportOptions(form, "all"))  # type: ignore[arg-type]

    def found(folder: Path) -> set[str]:
        content = [path.read_bytes().lower() for path in folder.rglob("*") if path.is_file()]
        content += [str(path).lower().encode() for path in folder.rglob("*")]
        # Parquet's columns may be compressed; what our reader gives is what they hold.
        content += [repr(list(open_export(folder).rows(table))).lower().encode() for table in exported.tables]
        return {each for each in told if any(each.lower().encode() in some for some in content)}

    assert found(plain) == set(told)
    assert found(exported.folder) == set()
    assert {(row["external_id"], str(row["other_ids"])) for row in exported.people()} == {(None, "{}")}


def test_one_person_has_one_pseudonym_everywhere(store: Store, told: list[str], tmp_path: Path) -> None:
    exported = pseudonymous(store, tmp_path / "out")
    other, who = (row["person_id"] for row in exported.people())
    adopted = next(row for row in exported.events(who) if row["kind"] == "population_adopted")
    assert adopted["payload"]["learned_from"][0] == other
    lineages = [row["lineage"]["sessions"] for row in exported.rows("networks")]
    assert lineages == [[who], [who, other]]
    (response,) = (row for row in exported.rows("events") if row["kind"] == "step_taken")
    assert response["payload"]["content"]["answers"]["accept"] == [f"I am [id], session {who}"]
    exported.check_digests()


def test_the_key_leads_back_and_only_its_owner_can_read_it(
    store: Store, told: list[str], tmp_path: Path
) -> None:
    exported = pseudonymous(store, tmp_path / "out")
    key = tmp_path / "out-key.csv"
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    with key.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["pseudonym"] for row in rows] == [row["person_id"] for row in exported.people()]
    assert [(row["person_id"], row["external_id"]) for row in rows] == [(told[0], ""), (told[1], PID)]


def test_pseudonyms_of_two_exports_have_nothing_in_common(
    store: Store, told: list[str], tmp_path: Path
) -> None:
    exports = [pseudonymous(store, tmp_path / name) for name in ("one", "two")]
    first, second = ({row["person_id"] for row in each.people()} for each in exports)
    assert not first & second


def test_times_count_from_the_persons_own_beginning_unless_they_are_kept(
    store: Store, told: list[str], tmp_path: Path
) -> None:
    plain = tmp_path / "plain"
    export(store, plain, ExportOptions("csv", "all"))
    moved = pseudonymous(store, tmp_path / "moved")
    kept = pseudonymous(store, tmp_path / "kept", keeps_times=True)
    known = [row["at"] - row_["created_at"] for row, row_ in last_events(open_export(plain))]
    assert [row["at"] - row_["created_at"] for row, row_ in last_events(moved)] == known
    assert {row["created_at"] for row in moved.people()} == {datetime(1970, 1, 1, tzinfo=UTC)}
    assert [row["created_at"] for row in kept.people()] == [
        row["created_at"] for row in open_export(plain).people()
    ]
    assert {row["received_at"].year for row in moved.rows("measures")} == {1970}


def last_events(export_: Export) -> list[tuple[dict, dict]]:
    people = [row for row in export_.people() if export_.events(row["person_id"])]
    return [(export_.events(row["person_id"])[-1], row) for row in people]


def test_an_export_with_pseudonyms_is_derived_again(database: str, tmp_path: Path) -> None:
    with open_store(database) as store:
        exported = pseudonymous(store, tmp_path / "out", "jsonl")
    assert [person.n_queries >= 12 for person in replayed(exported.folder)][:2] == [True, True]


def test_the_key_is_never_overwritten_nor_exported(store: Store, told: list[str], tmp_path: Path) -> None:
    (tmp_path / "out-key.csv").write_text("precious")
    with pytest.raises(ExportError, match="Name a new file"):
        pseudonymous(store, tmp_path / "out")
    assert (tmp_path / "out-key.csv").read_text() == "precious"
    options = ExportOptions(has_pseudonyms=True, key_file=tmp_path / "out" / "key.csv")
    with pytest.raises(ExportError, match="elsewhere"):
        export(store, tmp_path / "out", options)
    assert not (tmp_path / "out").exists()


def test_a_failed_export_leaves_no_key(store: Store, told: list[str], tmp_path: Path) -> None:
    def fail(done: int, total: int) -> None:
        raise KeyboardInterrupt

    options = ExportOptions(has_pseudonyms=True, key_file=tmp_path / "key.csv")
    with pytest.raises(KeyboardInterrupt):
        export(store, tmp_path / "out", options, fail)
    assert {path.name for path in tmp_path.iterdir()} <= {"study.db", "study.db-wal", "study.db-shm"}
