"""Reports on what was learned, made in the background: each takes minutes, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory

_LEAST_URGENT = 19
_LONGEST_COMPLAINT = 300


class Progress(StrEnum):
    """How far a report is."""

    NONE = "none"
    RUNNING = "running"
    READY = "ready"
    FAILED = "failed"


@dataclass(frozen=True)
class Report:
    """A report on one study.

    Attributes:
        progress: How far it is.
        begun_at: When it was begun; None if it wasn't.
        complaint: Why it has failed.
        path: The page, once it is ready.
    """

    progress: Progress
    begun_at: datetime | None = None
    complaint: str = ""
    path: Path | None = None


@dataclass
class _Work:
    process: subprocess.Popen[bytes]
    folder: TemporaryDirectory[str]
    begun_at: datetime

    @property
    def page(self) -> Path:
        return Path(self.folder.name) / "report.html"

    @property
    def complaints(self) -> Path:
        return Path(self.folder.name) / "complaints.txt"

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.folder.cleanup()


class Reports:
    """Makes reports, the last of each study being kept until the server ends. Fit for many threads."""

    def __init__(self, database: str) -> None:
        """Makes none yet.

        Args:
            database: URL of the database that they are about.
        """
        self._database = database
        self._works: dict[str, _Work] = {}
        self._lock = threading.Lock()

    def begin(self, study_name: str) -> None:
        """Begins a report, in the place of an earlier one; does nothing while one is being made."""
        with self._lock:
            known = self._works.get(study_name)
            if known is not None and known.process.poll() is None:
                return
            if known is not None:
                known.end()
            self._works[study_name] = self._started(study_name)

    def report(self, study_name: str) -> Report:
        """Returns the report on a study, as far as it is."""
        with self._lock:
            work = self._works.get(study_name)
        if work is None:
            return Report(Progress.NONE)
        status = work.process.poll()
        if status is None:
            return Report(Progress.RUNNING, work.begun_at)
        if status != 0:
            said = " ".join(work.complaints.read_text(errors="replace").split())
            return Report(Progress.FAILED, work.begun_at, said.rpartition("Error: ")[2][-_LONGEST_COMPLAINT:])
        return Report(Progress.READY, work.begun_at, path=work.page)

    def close(self) -> None:
        """Gives up what is being made, and removes what was."""
        with self._lock:
            for work in self._works.values():
                work.end()
            self._works.clear()

    def _started(self, study_name: str) -> _Work:
        folder = TemporaryDirectory(prefix="prefstudy-report-")
        # Where the database is may hold a password, which others could read among the arguments.
        environment = os.environ | {"PREFSTUDY_DATABASE": self._database}
        command = [sys.executable, "-m", "app.cli", "report", str(Path(folder.name) / "report.html")]
        with (Path(folder.name) / "complaints.txt").open("wb") as complaints:
            process = subprocess.Popen(
                [*command, "--study", study_name],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=complaints,
                env=environment,
            )
        # People are answering meanwhile. Windows has no such call.
        if hasattr(os, "setpriority"):
            os.setpriority(os.PRIO_PROCESS, process.pid, _LEAST_URGENT)
        return _Work(process, folder, datetime.now(UTC))
