"""A `prefstudy serve` of its own, in a process of its own, for tests that need the real thing."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

START_TIMEOUT_S = 300.0


def free_port() -> int:
    """Returns a port that is free now on the loopback address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class ServerProcess:
    """A running server; its log is in `folder`."""

    def __init__(self, folder: Path, study: str, port: int) -> None:
        self.folder, self.study, self.port = folder, study, port
        self.url = f"http://127.0.0.1:{port}"
        self.database = f"sqlite:///{folder / 'serve.db'}"
        self.process = self._start()

    def _start(self) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "app.cli", "serve", "--study", self.study, "--port", str(self.port)]
        with (self.folder / "serve.log").open("a") as log:
            process = subprocess.Popen(
                [*command, "--database", self.database],
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                start_new_session=True,
            )
        assert process.stdout is not None
        deadline = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < deadline and process.poll() is None:
            ready, _, _ = select.select([process.stdout], [], [], 0.2)
            if ready and "Participants open:" in process.stdout.readline():
                return process
        process.kill()
        raise AssertionError(f"the server did not start: {(self.folder / 'serve.log').read_text()}")

    def kill(self) -> None:
        """Kills the server as the kernel would: nothing gets to tidy up."""
        self.process.kill()
        self._wait_for_end()

    def restart(self) -> None:
        """Starts a server again on the same database and port."""
        self.process = self._start()

    def children(self, program: str) -> list[int]:
        """Returns the ids of the engine's processes of one kind: `dask_scheduler` or `dask_worker`."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and _is_child(entry, self.process.pid, program):
                found.append(int(entry.name))
        return found

    def stop(self) -> None:
        """Ends the server politely, or not."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self._wait_for_end(20)
            except subprocess.TimeoutExpired:
                self.kill()

    def _wait_for_end(self, timeout_s: float | None = None) -> None:
        self.process.wait(timeout_s)
        if self.process.stdout is not None:
            self.process.stdout.close()


def _is_child(entry: Path, parent: int, program: str) -> bool:
    try:
        is_ours = int(entry.joinpath("stat").read_text().rsplit(")", 1)[1].split()[1]) == parent
        return is_ours and program in entry.joinpath("cmdline").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


@contextmanager
def running_server(
    folder: Path, study: str = "quickstart", port: int | None = None
) -> Iterator[ServerProcess]:
    """Gives a server that is stopped at the end."""
    server = ServerProcess(folder, study, port or free_port())
    try:
        yield server
    finally:
        server.stop()


def kill_process(process_id: int) -> None:
    """Kills a process that may be gone already."""
    try:
        os.kill(process_id, signal.SIGKILL)
    except ProcessLookupError:
        return
