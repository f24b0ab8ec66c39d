"""Where computations run: Dask, in processes of its own.

The scheduler and the workers are child processes, so they don't share the web server's interpreter. A thread
looks after them: a worker that dies is replaced, and Dask runs its task again; when the scheduler dies everything is
started anew and what was pending is submitted again. Only pure functions are submitted, so twice changes nothing.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from distributed import Client
from distributed.client import Future as DaskFuture
from distributed.security import Security

from app.errors import AppError

log = logging.getLogger(__name__)

_START_TIMEOUT_S = 120.0
_REACH_TIMEOUT_S = 10.0
_WATCH_INTERVAL_S = 0.2
_QUERY_RESOURCE = {"query": 1}
# Without a dashboard Dask still opens an HTTP port for its own health pages.
_NO_FIXED_PORT = ("--dashboard-address", "127.0.0.1:0")
_DASK_SETTINGS = {
    "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "error",
    # Workers may be killed at any time; that is no sign of a bad task.
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "100",
}


class EngineError(AppError):
    """The engine can't be started or reached."""


class ComputationOnDemand:
    """A result that is computed when it is asked for."""

    def __init__(self, compute: Callable[[], Any]) -> None:
        self._compute = compute
        self._future: Future[Any] = Future()

    def done(self) -> bool:
        """Returns True: whoever asks for the result is the one to compute it."""
        return True

    def result(self, timeout: float | None = None) -> Any:
        """Returns the result, computed on the first call."""
        if not self._future.done():
            try:
                self._future.set_result(self._compute())
            except Exception as error:  # noqa: BLE001 - handed on to whoever asks
                self._future.set_exception(error)
        return self._future.result(timeout)

    def add_done_callback(self, fn: Callable[[Any], object], /) -> None:
        """Calls `fn` at once."""
        fn(self)

    def cancel(self) -> bool:
        """Returns True: what nobody asks for is never computed."""
        return True


class _EngineOnDemand:
    """Computes only what is asked for: for people who take no time, nothing is worth computing ahead."""

    def submit(
        self, key: str, function: Callable[..., Any], argument: object, urgency: float
    ) -> ComputationOnDemand:
        """Returns the computation; see `app.services.continuation.Engine`."""
        return ComputationOnDemand(lambda: self._compute(key, function, argument, urgency))

    def submit_together(
        self, function: Callable[..., Any], arguments: Mapping[str, object], urgency: float
    ) -> list[ComputationOnDemand]:
        """Returns a computation for each argument; only those that are asked for are computed."""
        return [self.submit(key, function, argument, urgency) for key, argument in arguments.items()]

    def _compute(self, key: str, function: Callable[..., Any], argument: object, urgency: float) -> Any:
        raise NotImplementedError


class InlineEngine(_EngineOnDemand):
    """Computes in this process: headless replay and simulation."""

    def _compute(self, key: str, function: Callable[..., Any], argument: object, urgency: float) -> Any:
        return function(argument)


class OnDemandEngine(_EngineOnDemand):
    """Computes on another engine: many simulated people at once."""

    def __init__(self, engine: DaskEngine) -> None:
        self._engine = engine

    def _compute(self, key: str, function: Callable[..., Any], argument: object, urgency: float) -> Any:
        return self._engine.submit(key, function, argument, urgency).result()


@dataclass
class _Pending:
    """A computation that has been submitted and not yet finished."""

    key: str
    function: Callable[..., Any]
    argument: object
    urgency: float
    future: Future[Any] = field(default_factory=Future)
    remote: DaskFuture | None = None


class DaskEngine:
    """Computes on a Dask cluster: one of its own on this machine, or one that runs already."""

    def __init__(self, n_workers: int = 2, scheduler_address: str | None = None) -> None:
        """Starts or reaches the cluster; returns when it takes work.

        Args:
            n_workers: Worker processes of a cluster of our own.
            scheduler_address: Address of a running scheduler instead.

        Raises:
            EngineError: It doesn't come up, or isn't there.
        """
        self._lock = threading.RLock()
        self._pending: dict[str, _Pending] = {}
        self._cluster = None if scheduler_address else LocalProcesses(n_workers)
        self._address = scheduler_address
        self._closing = threading.Event()
        self._client = self._connect()
        self._wait_until_warm()
        self._watcher = threading.Thread(target=self._watch, name="engine-watch", daemon=True)
        if self._cluster is not None:
            self._watcher.start()

    def submit(self, key: str, function: Callable[..., Any], argument: object, urgency: float) -> Future[Any]:
        """Starts computing `function(argument)`; see `app.services.continuation.Engine`."""
        return self.submit_together(function, {key: argument}, urgency)[0]

    def submit_together(
        self, function: Callable[..., Any], arguments: Mapping[str, object], urgency: float
    ) -> list[Future[Any]]:
        """Starts computing `function` of each argument; see `app.services.continuation.Engine`."""
        with self._lock:
            wanted = [
                self._known(key, urgency) or self._expect(_Pending(key, function, argument, urgency))
                for key, argument in arguments.items()
            ]
            unsent = [pending for pending in wanted if pending.remote is None]
            if unsent:
                self._send(unsent)
            return [pending.future for pending in wanted]

    def _known(self, key: str, urgency: float) -> _Pending | None:
        """Returns a computation that is under way; one that has become urgent is sent again, by itself."""
        known = self._pending.get(key)
        if known is None or known.future.cancelled():
            return None
        if urgency > known.urgency and not known.future.done():
            # Dask can't change the priority of a task it has.
            known.urgency = urgency
            self._withdraw(known)
            self._send([known], suffix="-urgent")
        return known

    def _expect(self, pending: _Pending) -> _Pending:
        self._pending[pending.key] = pending
        pending.future.add_done_callback(lambda _: self._forget(pending))
        return pending

    def close(self) -> None:
        """Gives up what is pending and stops the cluster if it is ours."""
        self._closing.set()
        if self._watcher.is_alive():
            self._watcher.join()
        with self._lock:
            for pending in list(self._pending.values()):
                pending.future.cancel()
            self._client.close(timeout=2)
            if self._cluster is not None:
                self._cluster.close()

    @property
    def process_ids(self) -> dict[str, list[int]]:
        """Returns the ids of our own cluster's processes, by role."""
        return {} if self._cluster is None else self._cluster.process_ids

    def _connect(self) -> Client:
        """Returns a client of the cluster, which is started first if it is ours."""
        if self._cluster is None:
            return self._reach(self._address, None, _REACH_TIMEOUT_S)
        self._cluster.start()
        deadline = time.monotonic() + _START_TIMEOUT_S
        while True:
            try:
                return self._reach(self._cluster.address, self._cluster.security, 3.0)
            except EngineError:
                # A new scheduler may have been killed as well; then there is no use in waiting for it.
                if not self._cluster.has_scheduler() or time.monotonic() > deadline:
                    raise

    def _reach(self, address: str | None, security: Security | None, timeout_s: float) -> Client:
        try:
            return Client(address, security=security, timeout=timeout_s, set_as_default=False)
        except (OSError, TimeoutError) as error:
            raise EngineError(
                f"The Dask scheduler at {address} can't be reached: {error}. Is it running?"
            ) from error

    def _wait_until_warm(self) -> None:
        """Waits for the first worker, which has compiled every kernel by then."""
        try:
            self._client.wait_for_workers(1, timeout=_START_TIMEOUT_S)
        except TimeoutError as error:
            raise EngineError(
                "No worker joined the Dask scheduler. Start one, or mend what its log says."
            ) from error

    def _send(self, batch: list[_Pending], suffix: str = "") -> None:
        """Sends computations as one task: its message and its result cost more than many a computation."""
        key = batch[0].key if len(batch) == 1 else _joint_key(pending.key for pending in batch)
        try:
            remote = self._client.submit(
                _compute_each,
                batch[0].function,
                [pending.argument for pending in batch],
                key=key + suffix,
                priority=batch[0].urgency,
                resources=_QUERY_RESOURCE if self._cluster is not None else None,
                pure=False,
            )
        except Exception:
            # A dead scheduler is replaced by the watcher, which sends everything pending again.
            log.exception("a computation could not be sent")
            return
        for pending in batch:
            pending.remote = remote
        remote.add_done_callback(lambda done: self._arrived(batch, done))

    def _arrived(self, batch: list[_Pending], remote: DaskFuture) -> None:
        """Hands results on; those lost with their scheduler stay pending, to be sent again."""
        waiting = [pending for pending in batch if pending.remote is remote]
        if not waiting or remote.status in ("cancelled", "lost"):
            return
        try:
            outcomes = dict(zip((pending.key for pending in batch), remote.result(timeout=10), strict=True))
        except Exception as error:  # noqa: BLE001 - handed on to whoever asks
            if not self._is_lost(error):
                for pending in waiting:
                    if pending.future.set_running_or_notify_cancel():
                        pending.future.set_exception(error)
            return
        for pending in waiting:
            if pending.future.set_running_or_notify_cancel():
                pending.future.set_result(outcomes[pending.key])

    def _is_lost(self, error: Exception) -> bool:
        """Returns whether an error says that the cluster is gone, not that the computation failed."""
        return isinstance(error, (OSError, TimeoutError)) or type(error).__name__ == "FutureCancelledError"

    def _forget(self, pending: _Pending) -> None:
        with self._lock:
            if self._pending.get(pending.key) is pending:
                del self._pending[pending.key]
            self._withdraw(pending)

    def _withdraw(self, pending: _Pending) -> None:
        """Tells Dask that nobody waits for a task any more, once that is so."""
        remote, pending.remote = pending.remote, None
        is_shared = any(other.remote is remote for other in self._pending.values())
        if remote is not None and not is_shared and not self._closing.is_set():
            remote.release()

    def _watch(self) -> None:
        assert self._cluster is not None
        while not self._closing.wait(_WATCH_INTERVAL_S):
            try:
                if not self._cluster.has_scheduler():
                    self._start_again()
                else:
                    self._cluster.replace_dead_workers()
            except Exception:
                log.exception("the engine could not be mended; trying again")

    def _start_again(self) -> None:
        """Starts a new cluster after its scheduler has died, and sends it what was pending."""
        log.warning("the scheduler has died; starting a new one")
        assert self._cluster is not None
        old = self._client
        self._cluster.stop()
        client = self._connect()
        with self._lock:
            self._client = client
            for pending in list(self._pending.values()):
                self._send([pending])
        old.close(timeout=1)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Waits for a process that is dead or dying, and closes our end of its standard input."""
    process.wait()
    if process.stdin is not None:
        process.stdin.close()


def _compute_each(function: Callable[[object], Any], arguments: list[object]) -> list[Any]:
    """Runs in a worker: one after the other, the first first."""
    return [function(argument) for argument in arguments]


def _joint_key(keys: Iterable[str]) -> str:
    return f"together-{hashlib.sha256(' '.join(keys).encode()).hexdigest()}"


class LocalProcesses:
    """A scheduler and its workers as child processes, on the loopback address, with TLS of their own."""

    def __init__(self, n_workers: int) -> None:
        self.security = Security.temporary()
        self._n_workers = n_workers
        self._scheduler: subprocess.Popen[bytes] | None = None
        self._workers: list[subprocess.Popen[bytes]] = []
        self._folder = tempfile.TemporaryDirectory(prefix="prefstudy-engine-")
        self._tls_options = self._write_credentials()
        self.address = ""

    @property
    def process_ids(self) -> dict[str, list[int]]:
        """Returns the process ids by role."""
        scheduler = [] if self._scheduler is None else [self._scheduler.pid]
        return {"scheduler": scheduler, "worker": [worker.pid for worker in self._workers]}

    def start(self) -> None:
        """Starts the scheduler, then the workers."""
        address_file = Path(self._folder.name) / f"scheduler-{time.monotonic_ns()}.json"
        options = ["--host", "tls://127.0.0.1", "--port", "0", "--scheduler-file", str(address_file)]
        self._scheduler = self._spawn("dask_scheduler", options)
        self.address = self._read_address(address_file)
        self._workers = [self._spawn_worker() for _ in range(self._n_workers)]

    def has_scheduler(self) -> bool:
        """Returns whether the scheduler is alive."""
        return self._scheduler is not None and self._scheduler.poll() is None

    def replace_dead_workers(self) -> None:
        """Starts a new worker for each one that has died."""
        for index, worker in enumerate(self._workers):
            if worker.poll() is not None:
                log.warning("worker %d has died; starting another", worker.pid)
                _end(worker)
                self._workers[index] = self._spawn_worker()

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

    def _spawn_worker(self) -> subprocess.Popen[bytes]:
        options = [self.address, "--nthreads", "1", "--no-nanny", "--resources", "query=1"]
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
        command += ["--preload", "app.engine_child", *self._tls_options]
        environment = os.environ | _DASK_SETTINGS
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment, start_new_session=True
        )

    def _read_address(self, address_file: Path) -> str:
        deadline = time.monotonic() + _START_TIMEOUT_S
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
