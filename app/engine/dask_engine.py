"""An engine on Dask, in processes of its own.

The scheduler and the workers are child processes, so they don't share the web server's interpreter. A thread
looks after them: a worker that dies is replaced, and Dask runs its task again; when the scheduler dies everything is
started anew and what was pending is submitted again. Only pure functions are submitted, so twice changes nothing.
"""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import dask
from distributed import Client, Worker
from distributed.client import Future as DaskFuture
from distributed.diagnostics.plugin import WorkerPlugin
from distributed.security import Security

from app.engine.processes import START_TIMEOUT_S, EngineError, LocalProcesses
from app.services.continuation import Resource

log = logging.getLogger(__name__)

_REACH_TIMEOUT_S = 10.0
_WATCH_INTERVAL_S = 0.2
_LATELY_S = 600.0


@dataclass
class _Pending:
    """A computation that has been submitted and not yet finished."""

    key: str
    function: Callable[..., Any]
    argument: object
    urgency: float
    resource: Resource
    future: Future[Any] = field(default_factory=Future)
    remote: DaskFuture | None = None


class DaskEngine:
    """Computes on a Dask cluster: one of its own on this machine, or one that runs already."""

    def __init__(
        self,
        n_workers: int = 2,
        scheduler_address: str | None = None,
        warm_up: Callable[[], object] | None = None,
        n_training_workers: int = 0,
    ) -> None:
        """Starts or reaches the cluster; returns when it takes work.

        Args:
            n_workers: Worker processes of a cluster of our own that compute queries.
            scheduler_address: Address of a running scheduler instead; all its workers compute everything.
            warm_up: Run by every worker that computes queries before it takes work.
            n_training_workers: Worker processes of a cluster of our own that train, and do nothing else; with none,
                those that compute queries train as well.

        Raises:
            EngineError: It doesn't come up, or isn't there.
        """
        # Dask keeps its last thousand messages, whole, for whoever debugs it: people's answers among them.
        dask.config.set({"distributed.admin.low-level-log-length": 0})
        self._lock = threading.RLock()
        self._pending: dict[str, _Pending] = {}
        self._cluster = None if scheduler_address else LocalProcesses(n_workers, n_training_workers)
        self._address = scheduler_address
        self._closing = threading.Event()
        self._deaths: deque[float] = deque(maxlen=100)
        self._warm_up = warm_up
        self._client = self._connect()
        # Whoever trains needs no warming up and may be first; so many have joined only if one who is warm has.
        self._wait_for_workers(1 if scheduler_address else min(n_workers, 1) + n_training_workers)
        self._watcher = threading.Thread(target=self._watch, name="engine-watch", daemon=True)
        if self._cluster is not None:
            self._watcher.start()

    def submit(
        self,
        key: str,
        function: Callable[..., Any],
        argument: object,
        urgency: float,
        resource: Resource = "query",
    ) -> Future[Any]:
        """Starts computing `function(argument)`; see `app.services.continuation.Engine`."""
        return self._submit(function, {key: argument}, urgency, resource)[0]

    def submit_together(
        self, function: Callable[..., Any], arguments: Mapping[str, object], urgency: float
    ) -> list[Future[Any]]:
        """Starts computing `function` of each argument; see `app.services.continuation.Engine`."""
        return self._submit(function, arguments, urgency, "query")

    def _submit(
        self,
        function: Callable[..., Any],
        arguments: Mapping[str, object],
        urgency: float,
        resource: Resource,
    ) -> list[Future[Any]]:
        with self._lock:
            wanted = [
                self._known(key, urgency)
                or self._expect(_Pending(key, function, argument, urgency, resource))
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

    def troubles(self) -> list[str]:
        """Returns what is wrong with it, or was lately; see `app.services.continuation.Engine`."""
        if self._cluster is None:
            is_there = self._client.status == "running"
            return [] if is_there else [f"The Dask scheduler at {self._address} can’t be reached."]
        n_dead = sum(at > time.monotonic() - _LATELY_S for at in list(self._deaths))
        if not n_dead:
            return []
        processes = "process" if n_dead == 1 else "processes"
        return [f"{n_dead} {processes} of the engine died in the last ten minutes and had to be replaced."]

    @property
    def process_ids(self) -> dict[str, list[int]]:
        """Returns the ids of our own cluster's processes, by role."""
        return {} if self._cluster is None else self._cluster.process_ids

    def _connect(self) -> Client:
        """Returns a client of the cluster, which is started first if it is ours."""
        if self._cluster is None:
            return self._reach(self._address, None, _REACH_TIMEOUT_S)
        self._cluster.start()
        deadline = time.monotonic() + START_TIMEOUT_S
        while True:
            try:
                return self._reach(self._cluster.address, self._cluster.security, 3.0)
            except EngineError:
                # A new scheduler may have been killed as well; then there is no use in waiting for it.
                if not self._cluster.has_scheduler() or time.monotonic() > deadline:
                    raise

    def _reach(self, address: str | None, security: Security | None, timeout_s: float) -> Client:
        try:
            client = Client(address, security=security, timeout=timeout_s, set_as_default=False)
        except (OSError, TimeoutError) as error:
            raise EngineError(
                f"The Dask scheduler at {address} can't be reached: {error}. Is it running?"
            ) from error
        if self._warm_up is not None:
            client.register_plugin(_WarmUp(self._warm_up))
        return client

    def _wait_for_workers(self, n_workers: int) -> None:
        """Waits for the first workers; who computes queries is warm when they join."""
        try:
            self._client.wait_for_workers(n_workers, timeout=START_TIMEOUT_S)
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
                resources={batch[0].resource: 1} if self._cluster is not None else None,
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
                    self._deaths.extend([time.monotonic()] * self._cluster.replace_dead_workers())
            except Exception:
                log.exception("the engine could not be mended; trying again")

    def _start_again(self) -> None:
        """Starts a new cluster after its scheduler has died, and sends it what was pending."""
        log.warning("the scheduler has died; starting a new one")
        self._deaths.append(time.monotonic())
        assert self._cluster is not None
        old = self._client
        self._cluster.stop()
        client = self._connect()
        with self._lock:
            self._client = client
            for pending in list(self._pending.values()):
                self._send([pending])
        old.close(timeout=1)


class _WarmUp(WorkerPlugin):
    """Makes a worker ready for queries; later workers run it before they join."""

    name = "warm-up"

    def __init__(self, warm_up: Callable[[], object]) -> None:
        self._warm_up = warm_up

    def setup(self, worker: Worker) -> None:
        """Runs once in each worker."""
        if "query" in worker.state.total_resources:
            self._warm_up()


def _compute_each(function: Callable[[object], Any], arguments: list[object]) -> list[Any]:
    """Runs in a worker: one after the other, the first first."""
    return [function(argument) for argument in arguments]


def _joint_key(keys: Iterable[str]) -> str:
    return f"together-{hashlib.sha256(' '.join(keys).encode()).hexdigest()}"
