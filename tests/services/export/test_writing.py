"""An export is written whole or not at all, in bounded memory, whatever the study does meanwhile."""

from __future__ import annotations

import resource
import threading
import tracemalloc
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import gettempdir

import pytest

from app.continuation import build_clips
from app.services.export import Export, ExportError, ExportOptions, export, open_export, writing
from app.services.export.archive import Archive
from app.services.export.tables import tables_of
from app.store import ImportedSession, NewEvent, Source, Store, StoreError, open_store
from tests.services.export.people import FULL_PATH, QUICKSTART


def test_an_export_never_overwrites(database: str, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with open_store(database) as store, pytest.raises(ExportError, match="not empty"):
        export(store, tmp_path, ExportOptions())
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_an_empty_folder_and_a_nested_one_will_do(database: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with open_store(database) as store:
        for folder in (tmp_path / "empty", tmp_path / "in" / "here"):
            export(store, folder, ExportOptions())
            open_export(folder).check_digests()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (ExportOptions(), "Expected real people to export, found nobody. Has anyone begun?"),
        (ExportOptions(people="all"), "Expected anybody to export, found nobody"),
        (ExportOptions(study="quick"), "Expected the name of a study, got 'quick'. Here are: none"),
    ],
)
def test_an_export_of_nobody_says_so(store: Store, tmp_path: Path, options: ExportOptions, said: str) -> None:
    with pytest.raises(ExportError, match=said):
        export(store, tmp_path / "out", options)
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "out.partial").exists()


def test_a_folder_that_cannot_be_made_is_named(database: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with open_store(database) as store:
        for folder in (tmp_path / "file" / "out", Path("/proc/out")):
            with pytest.raises(ExportError, match=r"Can't write to .* Name another folder") as caught:
                export(store, folder, ExportOptions())
            assert "\n" not in str(caught.value)


def test_what_another_export_left_unfinished_is_not_touched(database: str, tmp_path: Path) -> None:
    (tmp_path / "out.partial").mkdir()
    with open_store(database) as store, pytest.raises(ExportError, match=r"out\.partial is there already"):
        export(store, tmp_path / "out", ExportOptions())
    assert [path.name for path in tmp_path.iterdir()] == ["out.partial"]


@contextmanager
def room_for(n_bytes: int) -> Iterator[None]:
    """No file can grow longer: what a full disk looks like from here."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("form", ["csv", "parquet", "jsonl"])
@pytest.mark.parametrize("n_bytes", [100, 10_000])
def test_a_full_disk_ends_an_export_with_one_line_and_nothing_written(
    database: str, tmp_path: Path, form: str, n_bytes: int
) -> None:
    with open_store(database) as store:
        store.sessions()
        with room_for(n_bytes), pytest.raises(ExportError, match=r"Can't write to .* Make room") as caught:
            export(store, tmp_path / "out", ExportOptions(form, "all"))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_export_leaves_nothing(database: str, tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with open_store(database) as store, pytest.raises(KeyboardInterrupt):
        export(store, tmp_path / "out", ExportOptions("parquet", "all"), interrupt)
    assert list(tmp_path.iterdir()) == []


def test_an_export_while_people_answer_sees_each_at_one_moment(
    store: Store, tmp_path: Path, database: str
) -> None:
    """Every append of the log's five entries goes together with a posterior; an export has both or neither."""
    with open_store(database) as walked:
        record = next(each for each in walked.sessions() if each.source is Source.REHEARSED)
        logged, kept = walked.events(record.id), walked.posteriors(record.id)
    queries = [event for event in logged if event.kind == "query_prepared"][: len(kept)]
    store.put_study(QUICKSTART.hash, QUICKSTART.name, QUICKSTART.text)
    people = [store.create_session(QUICKSTART.hash, f"t{i}", Source.JOINED).id for i in range(20)]
    for person in people:
        store.append(person, 0, [NewEvent("session_begun", {"participant": 1})])
    is_over = threading.Event()

    def answer() -> None:
        for index, (query, posterior) in enumerate(zip(queries, kept, strict=True)):
            for person in people:
                if is_over.is_set():
                    return
                answered = {"query_index": index, "choice": "a", "response_time_ms": 1}
                events = [NewEvent("query_prepared", query.payload), NewEvent("answer_given", answered)]
                store.append(person, 1 + 2 * index, events, posterior)

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        exports = []
        for number in range(6):
            export(store, tmp_path / str(number), ExportOptions("parquet", samples="none"))
            exports.append(open_export(tmp_path / str(number)))
    finally:
        is_over.set()
        thread.join()
    lengths = [sum(1 for _ in each.rows("events")) for each in exports]
    assert lengths == sorted(lengths)
    assert lengths[-1] > lengths[0], "somebody must have answered meanwhile"
    for each in exports:
        each.check_digests()
        for person in each.people():
            told = {
                table: [
                    row["query_index"] for row in each.rows(table) if row["person_id"] == person["person_id"]
                ]
                for table in ("queries", "answers", "posteriors")
            }
            assert told["queries"] == told["answers"] == told["posteriors"]
            assert len(each.events(person["person_id"])) == 1 + 2 * person["n_answers"]


@pytest.fixture(scope="module")
def crowds(database: str, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Databases of 12 and of 36 people: one rehearsed person's log and posteriors, kept again and again."""
    with open_store(database) as walked:
        record = next(each for each in walked.sessions() if each.source is Source.REHEARSED)
        events = tuple(NewEvent(each.kind, each.payload) for each in walked.events(record.id))
        posteriors = walked.posteriors(record.id)
    study = (QUICKSTART.hash, QUICKSTART.name, QUICKSTART.text)
    urls = []
    for n_people in (12, 36):
        urls.append(f"sqlite:///{tmp_path_factory.mktemp('crowd') / 'crowd.db'}")
        with open_store(urls[-1]) as store:
            for number in range(n_people):
                store.add_imported(ImportedSession(f"{number:064x}", *study, events, posteriors))
    return urls


@pytest.mark.slow
@pytest.mark.parametrize("form", ["csv", "parquet", "jsonl"])
def test_memory_does_not_grow_with_the_people(
    crowds: list[str], tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks are scaled down with the people: a few of them must fill several."""
    small = [replace(table, block=64) for table in tables_of([QUICKSTART], with_samples=False)]
    monkeypatch.setattr(writing, "tables_of", lambda *_: tuple(small))
    options = ExportOptions(form, "imported", samples="none")  # type: ignore[arg-type]
    peaks = []
    for number, url in enumerate(crowds):
        with open_store(url) as store:
            store.person(store.sessions()[0].id)  # which fills the connection's caches
            if number == 0:
                export(store, tmp_path / "first", options)  # and this all others
            tracemalloc.start()
            export(store, tmp_path / str(number), options)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_clips_are_those_that_people_saw(database: str, tmp_path: Path) -> None:
    with open_store(database) as store:
        export(
            store,
            tmp_path / "out",
            ExportOptions("jsonl", "rehearsed", study="full-path"),
            build_clips=build_clips,
        )
    exported = open_export(tmp_path / "out")
    logged = {digest for row in exported.rows("queries") for digest in row["clips"].values()}
    assert {path.stem for path in (tmp_path / "out" / "clips").glob("*.glb")} == logged
    assert {row["study_hash"] for row in exported.people()} == {FULL_PATH.hash}
    exported.check_digests()


def left_behind() -> set[Path]:
    return set(Path(gettempdir()).glob("prefstudy-export-*"))


def test_an_archive_holds_the_same_export(database: str, exports: dict[str, Export], tmp_path: Path) -> None:
    before = left_behind()
    with open_store(database) as store:
        archive = Archive(store, ExportOptions("parquet", "all", samples="all"), "quickstart")
        assert archive.n_people == 7
        content = b"".join(archive)
    with zipfile.ZipFile(BytesIO(content)) as packed:
        assert packed.testzip() is None
        packed.extractall(tmp_path)
    exported = open_export(tmp_path / "quickstart")
    exported.check_digests()
    assert exported.manifest.digest == exports["parquet"].manifest.digest
    assert left_behind() == before


def test_an_archive_that_nobody_wants_any_more_leaves_nothing(database: str, store: Store) -> None:
    before = left_behind()
    with open_store(database) as full:
        pieces = iter(Archive(full, ExportOptions("csv", "all"), "out"))
        next(pieces)
        assert left_behind() > before
        pieces.close()  # type: ignore[attr-defined]
        assert left_behind() == before
        with Archive(full, ExportOptions("csv", "all"), "out"):
            assert left_behind() > before
    assert left_behind() == before
    with pytest.raises(ExportError, match="found nobody"):
        Archive(store, ExportOptions(), "out")
    assert left_behind() == before


def test_a_database_that_fails_in_the_middle_leaves_nothing(database: str, tmp_path: Path) -> None:
    store = open_store(database)

    def close(done: int, total: int) -> None:
        store.close()

    with pytest.raises(StoreError):
        export(store, tmp_path / "out", ExportOptions("csv", "all"), close)
    assert list(tmp_path.iterdir()) == []
