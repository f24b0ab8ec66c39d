"""The real server in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from app.bench.report import BenchError
from app.settings import ROOT

_START_TIMEOUT_S = 180.0
_STOP_TIMEOUT_S = 20.0
_ANNOUNCEMENT = "Participants open: "


@contextmanager
def running_server(database: str, study_name: str) -> Iterator[str]:
    """Serves a study on a free port for as long as the block runs; gives the participants' link.

    Raises:
        BenchError: It doesn't start.
    """
    options = ["--study", study_name, "--database", database, "--host", "127.0.0.1", "--port", "0"]
    command = [sys.executable, "-c", "from app.cli import main; main()", "serve", *options]
    with TemporaryFile() as complaints:
        server = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=complaints)
        try:
            yield _announced_link(server, complaints)
        finally:
            _stop(server)


def free_database(folder: str) -> str:
    """Returns the URL of a database that doesn't exist yet."""
    return f"sqlite:///{Path(folder) / 'bench.db'}"


def _announced_link(server: subprocess.Popen[bytes], complaints: IO[bytes]) -> str:
    """Waits for the line that names the link; a server that never says it is killed, which ends the waiting."""
    timer = threading.Timer(_START_TIMEOUT_S, server.kill)
    timer.start()
    assert server.stdout is not None
    try:
        for line in server.stdout:
            if line.decode().startswith(_ANNOUNCEMENT):
                return line.decode().removeprefix(_ANNOUNCEMENT).strip()
    finally:
        timer.cancel()
    complaints.seek(0)
    reason = complaints.read().decode(errors="replace").strip().rpartition("\n")[2]
    raise BenchError(f"Expected the server to start, got: {reason or 'nothing within the time'}.")


def _stop(server: subprocess.Popen[bytes]) -> None:
    server.terminate()
    try:
        server.wait(_STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
    if server.stdout is not None:
        server.stdout.close()
