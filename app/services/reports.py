"""Reports that experimenters ask for at the desk: written by a process of their own, so that nobody waits for them.

It is the command line that writes them, with low priority: minutes of computing would hold up every participant if they
ran inside the server.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from tempfile import mkdtemp

_LOWEST_PRIORITY = 19


class ReportKind(StrEnum):
    """What can be written."""

    APPENDIX = "appendix"
    """How the study was run; Markdown."""
    REPORT = "report"
    """What was learned from people; one HTML page."""

    @property
    def suffix(self) -> str:
        """Returns how its file ends."""
        return ".md" if self is ReportKind.APPENDIX else ".html"


class ReportStatus(StrEnum):
    """How far a report is."""

    NONE = "none"
    RUNNING = "running"
    READY = "ready"
    FAILED = "failed"


@dataclass(frozen=True)
class ReportState:
    """A report on the shelf.

    Attributes:
        status: How far it is.
        asked_at: When it was asked for, aware, UTC; None if it never was.
        people: Whose sessions it is about.
        problem: Why it failed; empty if it didn't.
        path: The file, once it is ready.
    """

    status: ReportStatus
    asked_at: datetime | None = None
    people: str = "real"
    problem: str = ""
    path: Path | None = None


@dataclass
class _Job:
    process: subprocess.Popen[str]
    people: str
    asked_at: datetime
    path: Path
    log: Path


class ReportShelf:
    """The newest report of each kind of each study, until the server ends. Fit for many threads."""

    def __init__(self, database: str) -> None:
        """Begins empty.

        Args:
            database: URL of the database that reports are about.
        """
        self._database = database
        self._folder = Path(mkdtemp(prefix="prefstudy-reports-"))
        self._jobs: dict[tuple[str, ReportKind], _Job] = {}
        self._lock = threading.Lock()

    def begin(self, study_name: str, kind: ReportKind, people: str) -> None:
        """Starts to write a report, in the place of an older one; one that is being written goes on."""
        with self._lock:
            known = self._jobs.get((study_name, kind))
            if known is not None and known.process.poll() is None:
                return
            at = datetime.now(UTC)
            path = self._folder / f"{study_name}-{kind}-{at:%Y%m%dT%H%M%S%f}{kind.suffix}"
            log = path.with_suffix(".log")
            command = [sys.executable, "-m", "app.cli", kind.value, str(path), "--study", study_name]
            with log.open("w", encoding="utf-8") as file:
                process = subprocess.Popen(
                    [*_politely(), *command, "--people", people],
                    # Addresses of databases may hold passwords, which arguments show to everyone.
                    env={**os.environ, "PREFSTUDY_DATABASE": self._database, "TERM": "dumb"},
                    stdout=subprocess.DEVNULL,
                    stderr=file,
                    text=True,
                    start_new_session=True,
                )
            self._jobs[study_name, kind] = _Job(process, people, at, path, log)

    def state(self, study_name: str, kind: ReportKind) -> ReportState:
        """Returns how far a report is."""
        with self._lock:
            job = self._jobs.get((study_name, kind))
            if job is None:
                return ReportState(ReportStatus.NONE)
            code = job.process.poll()
        if code is None:
            return ReportState(ReportStatus.RUNNING, job.asked_at, job.people)
        if code == 0:
            return ReportState(ReportStatus.READY, job.asked_at, job.people, path=job.path)
        return ReportState(ReportStatus.FAILED, job.asked_at, job.people, _last_words(job.log))

    def close(self) -> None:
        """Gives up what is being written, and clears the shelf."""
        with self._lock:
            for job in self._jobs.values():
                if job.process.poll() is None:
                    job.process.kill()
                job.process.wait()
            shutil.rmtree(self._folder, ignore_errors=True)


def _politely() -> list[str]:
    nice = shutil.which("nice")
    return [nice, "-n", str(_LOWEST_PRIORITY)] if nice else []


def _last_words(log: Path) -> str:
    """Returns why a command has failed: its error, which is one line."""
    lines = [line for line in log.read_text(encoding="utf-8").splitlines() if line.strip()]
    told = [line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")]
    return (told or lines or ["The process ended without a word."])[-1]
