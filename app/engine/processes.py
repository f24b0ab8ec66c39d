"""The cluster of our own: a scheduler and its workers, started, watched and ended as child processes."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from distributed.security import Security

from app.errors import AppError

log = logging.getLogger(__name__)

START_TIMEOUT_S = 120.0
"""How long a scheduler or the first worker may take to be ready."""

# Without a dashboard Dask still opens an HTTP port for its own health pages.
_NO_FIXED_PORT = ("--dashboard-address", "127.0.0.1:0")
_DASK_SETTINGS = {
    "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "error",
    # Workers may be killed at any time; that is no sign of a bad task.
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "100",
    # As in the engine's own process: no log of messages.
    "DASK_DISTRIBUTED__ADMIN__LOW_LEVEL_LOG_LENGTH": "0",
}


class EngineError(AppError):
    """The engine can't be started or reached."""


class LocalProcesses:
    """A scheduler and its workers as child processes, on the loopback address, with TLS of their own.

    Without workers of its own for training, those that compute queries train as well.
    """

    def __init__(self, n_workers: int, n_training_workers: int) -> None:
        self.security = Security.temporary()
        # Dask doesn't preempt: where people wait, whoever trains never computes what they wait for.
        querying = ("query",) if n_training_workers else ("query", "training")
        self._resources = [querying] * n_workers + [("training",)] * n_training_workers
        self._scheduler: subprocess.Popen[bytes] | None = None
        self._workers: list[subprocess.Popen[bytes]] = []
        self._folder = tempfile.TemporaryDirectory(prefix="prefstudy-engine-")
        self._tls_options = self._write_credentials()
        self.address = ""

    @property
    def process_ids(self) -> dict[str, list[int]]:
        """Returns the process ids by role."""
        scheduler = [] if self._scheduler is None else [self._scheduler.pid]
        workers = [
            (resources[0], worker.pid)
            for resources, worker in zip(self._resources, self._workers, strict=False)
        ]
        return {
            "scheduler": scheduler,
            "worker": [pid for resource, pid in workers if resource == "query"],
            "trainer": [pid for resource, pid in workers if resource == "training"],
        }

    def start(self) -> None:
        """Starts the scheduler, then the workers."""
        address_file = Path(self._folder.name) / f"scheduler-{time.monotonic_ns()}.json"
        options = ["--host", "tls://127.0.0.1", "--port", "0", "--scheduler-file", str(address_file)]
        self._scheduler = self._spawn("dask_scheduler", options)
        self.address = self._read_address(address_file)
        self._workers = [self._spawn_worker(resources) for resources in self._resources]

    def has_scheduler(self) -> bool:
        """Returns whether the scheduler is alive."""
        return self._scheduler is not None and self._scheduler.poll() is None

    def replace_dead_workers(self) -> int:
        """Starts a new worker for each one that has died; returns for how many."""
        n_dead = 0
        for index, worker in enumerate(self._workers):
            if worker.poll() is not None:
                log.warning("worker %d has died; starting another", worker.pid)
                _end(worker)
                self._workers[index] = self._spawn_worker(self._resources[index])
                n_dead += 1
        return n_dead

    def stop(self) -> None:
        """Ends all processes; they can be started again."""
        processes = [*self._workers, *([self._scheduler] if self._scheduler else [])]
        for process in processes:
            process.kill()
        for process in processes:
            _end(process)
        self._workers, self._scheduler = [], None

    def close(self) -> None:
        """Ends all processes for good."""
        self.stop()
        self._folder.cleanup()

    def _spawn_worker(self, resources: tuple[str, ...]) -> subprocess.Popen[bytes]:
        offered = " ".join(f"{resource}=1" for resource in resources)
        options = [self.address, "--nthreads", "1", "--no-nanny", "--resources", offered]
        options += ["--host", "127.0.0.1", "--memory-limit", "0", "--local-directory", self._folder.name]
        return self._spawn("dask_worker", options)

    def _spawn(self, program: str, options: list[str]) -> subprocess.Popen[bytes]:
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.{program}",
            *options,
            "--no-dashboard",
            *_NO_FIXED_PORT,
        ]
        command += ["--preload", "app.engine.child", *self._tls_options]
        environment = os.environ | _DASK_SETTINGS
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment, start_new_session=True
        )

    def _read_address(self, address_file: Path) -> str:
        deadline = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < deadline and self.has_scheduler():
            try:
                return str(json.loads(address_file.read_text())["address"])
            except (FileNotFoundError, ValueError):
                time.sleep(0.02)
        raise EngineError("The Dask scheduler did not start. Its own message stands above.")

    def _write_credentials(self) -> list[str]:
        """Writes the temporary key and certificate where only we can read them; returns the options that name them."""
        folder = Path(self._folder.name)
        options = []
        for option, attribute in (
            ("--tls-ca-file", "tls_ca_file"),
            ("--tls-cert", "tls_scheduler_cert"),
            ("--tls-key", "tls_scheduler_key"),
        ):
            path = folder / f"{attribute}.pem"
            path.touch(mode=0o600)
            path.write_text(getattr(self.security, attribute))
            options += [option, str(path)]
        return options


def _end(process: subprocess.Popen[bytes]) -> None:
    """Waits for a process that is dead or dying, and closes our end of its standard input."""
    process.wait()
    if process.stdin is not None:
        process.stdin.close()
