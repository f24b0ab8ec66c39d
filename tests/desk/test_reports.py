"""Reports and backups from the desk: written beside the study, kept for those who may have them, in the audit."""

from __future__ import annotations

import sqlite3
import time
from contextlib import closing
from pathlib import Path

import httpx
import pytest

from app.services.reports import ReportKind, ReportShelf, ReportStatus
from app.store import Role
from tests.desk.conftest import Opener
from tests.desk.laboratory import Laboratory

_PATIENCE_S = 120.0


def waited_for(visitor: httpx.Client, address: str) -> dict[str, str]:
    until = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until:
        state: dict[str, str] = visitor.get(address).json()
        if state["status"] != "running":
            return state
        time.sleep(0.2)
    raise AssertionError("the report was not written")


def test_an_appendix_is_written_and_downloaded(opened: Opener) -> None:
    with opened() as lab:
        lab.completed()
        n_completed = sum(line.ending == "completed" for line in lab.store.person_lines("quickstart"))
        with lab.browser(Role.ASSISTANT) as visitor:
            page = visitor.get("/desk/studies/quickstart/reports")
            assert "Write it" in page.text
            assert "Download" not in page.text
            begun = visitor.post("/desk/studies/quickstart/reports/appendix", data={"people": "real"})
            assert begun.status_code == 303
            assert waited_for(visitor, "/api/v1/studies/quickstart/reports/appendix")["status"] == "ready"
            assert "Download" in visitor.get("/desk/studies/quickstart/reports").text
            file = visitor.get("/desk/studies/quickstart/reports/appendix/file")
        assert "attachment" in file.headers["content-disposition"]
        assert f"| completed | {n_completed} |" in file.text
        (entry, *_) = lab.store.desk.audit()
        assert (entry.who, entry.action, entry.about) == ("adam", "report_asked_for", "quickstart")


def test_a_report_that_cannot_be_written_says_why(lab: Laboratory) -> None:
    with lab.program(Role.ASSISTANT) as program:
        address = "/api/v1/studies/quickstart/reports/report"
        assert program.get(address).json()["status"] == "none"
        assert program.get(f"{address}/file").status_code == 404
        assert program.post(address, json={"people": "rehearsed"}).status_code == 202
        state = waited_for(program, address)
        assert state["status"] == "failed"
        assert "Nobody here" in state["problem"]
        assert "Traceback" not in state["problem"]
    with lab.browser(Role.ASSISTANT) as visitor:
        assert "Nobody here" in visitor.get("/desk/studies/quickstart/reports").text


def test_a_study_that_there_is_not_has_no_report(lab: Laboratory) -> None:
    with lab.program(Role.ASSISTANT) as program:
        assert program.post("/api/v1/studies/nosuch/reports/appendix", json={}).status_code == 404


def test_what_is_being_written_ends_with_the_shelf(lab: Laboratory) -> None:
    shelf = ReportShelf(f"sqlite:///{lab.database}")
    shelf.begin("quickstart", ReportKind.REPORT, "real")
    assert shelf.state("quickstart", ReportKind.REPORT).status is ReportStatus.RUNNING
    shelf.close()
    assert shelf._jobs["quickstart", ReportKind.REPORT].process.poll() is not None
    assert not shelf._folder.exists()


def test_a_backup_holds_everything_and_leaves_nothing_behind(opened: Opener, tmp_path: Path) -> None:
    with opened() as lab:
        lab.completed()
        n_sessions = len(lab.store.sessions())
        with lab.browser(Role.OWNER) as visitor:
            assert "Download a backup" in visitor.get("/desk/").text
            file = visitor.get("/desk/backup")
        copy = tmp_path / "copy.db"
        copy.write_bytes(file.content)
        with closing(sqlite3.connect(copy)) as rows:
            assert rows.execute("SELECT count(*) FROM sessions").fetchone() == (n_sessions,)
            assert rows.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        (entry, *_) = lab.store.desk.audit()
        assert (entry.who, entry.action, entry.detail["n_sessions"]) == ("olga", "backed_up", n_sessions)


@pytest.mark.parametrize("role", [Role.ASSISTANT, Role.VIEWER])
def test_only_owners_have_backups(lab: Laboratory, role: Role) -> None:
    with lab.browser(role) as visitor:
        assert visitor.get("/desk/backup").status_code == 403
        assert "Download a backup" not in visitor.get("/desk/").text
