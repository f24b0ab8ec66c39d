"""`prefstudy serve` as a process: what it refuses to start with, and how it ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import httpx

from tests.support.screens import screens
from tests.support.server import ServerProcess, free_port, running_server
from tests.web.conftest import join


def refused(database: str, port: int) -> str:
    """Starts a server that must not start; returns what it says besides its first line."""
    command = [sys.executable, "-m", "app.cli", "serve", "--database", database, "--port", str(port)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 1
    assert ended.stdout == ""
    started, *said = ended.stderr.strip().splitlines()
    assert started.startswith("Starting quickstart")
    (line,) = said
    return line


def test_a_second_server_on_the_same_database_is_refused_in_one_line(server: ServerProcess) -> None:
    line = refused(server.database, free_port())
    assert line.startswith("Error: ")
    assert "already served by process" in line


def test_a_busy_port_is_refused_in_one_line(server: ServerProcess, tmp_path: Path) -> None:
    line = refused(f"sqlite:///{tmp_path / 'other.db'}", server.port)
    assert line.startswith("Error: ")
    assert f"Can't listen on 127.0.0.1:{server.port}" in line
    assert "--port" in line


def test_sigterm_ends_the_server_and_its_engine_cleanly_while_somebody_waits(tmp_path: Path) -> None:
    with running_server(tmp_path) as server:
        engine = [*server.children("dask_scheduler"), *server.children("dask_worker")]
        assert len(engine) == 4  # a scheduler, two workers for queries, one that trains
        token = join(server)
        with httpx.Client(base_url=server.url, timeout=60.0) as client:
            told = screens(client, f"/s/{token}/")
            assert next(told)["kind"] == "question"
            server.process.send_signal(signal.SIGTERM)
            assert list(told) == []
            assert server.process.wait(60) == 0
        assert server.process.stdout is not None
        server.process.stdout.close()
        assert not [process_id for process_id in engine if Path(f"/proc/{process_id}").exists()]
        log = (server.folder / "serve.log").read_text()
        assert "Traceback" not in log
        assert "graceful" not in log, "somebody had to be thrown out"
