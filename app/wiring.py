"""The only module that joins the parts."""

from __future__ import annotations

import gc
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from urllib.parse import urlsplit

import uvicorn

from app.continuation import continue_session, learn, scenes, test_set, warm_up
from app.desk.api import create_api
from app.desk.parts import DeskParts
from app.desk.site import create_desk
from app.engine.dask_engine import DaskEngine
from app.engine.on_demand import InlineEngine, OnDemandEngine
from app.errors import AppError
from app.services import study as services
from app.services.continuation import Engine
from app.services.desk_accounts import DeskAccounts
from app.services.population import PopulationTrainer
from app.services.reports import ReportShelf
from app.services.retention import DailyForgetting
from app.services.runtime import Runtime
from app.services.shown import shown
from app.services.standing import catch_up
from app.services.training import Trainer
from app.stage.keeper import StageKeeper
from app.stage.routes import stage_routes
from app.stage.stage import Picture
from app.store import Source, Store, open_existing_store, open_store, serve_lock
from app.training import PERSONAL_NETWORK, fit_population
from app.web.changes import Changes
from app.web.parts import SiteParts
from app.web.site import create_site
from study_core.study import Study

_LOOPBACK = ("127.0.0.1", "::1", "localhost")


class ServeError(AppError):
    """The server can't be started as asked."""


@dataclass(frozen=True)
class ServeSettings:
    """How to serve a study.

    Attributes:
        study: What people can join.
        database: URL of the database.
        host: Address to listen on.
        port: Port to listen on; 0 takes a free one.
        n_workers: Worker processes of our own engine.
        scheduler: Address of a running Dask scheduler instead.
        public_url: Address that participants use.
    """

    study: Study
    database: str
    host: str
    port: int
    n_workers: int
    scheduler: str | None
    public_url: str | None


@dataclass(frozen=True)
class Addresses:
    """Where people come in.

    Attributes:
        join: Participants.
        desk: Experimenters.
        setup_code: What makes the first of them; None where there is somebody already.
        n_before: How many people have begun another version of the study.
    """

    join: str
    desk: str
    setup_code: str | None
    n_before: int


def serve(settings: ServeSettings, announce: Callable[[Addresses], None]) -> None:
    """Serves a study until it is told to stop.

    Args:
        settings: How.
        announce: Told where people come in, as soon as it works.

    Raises:
        ServeError: The port is busy, or the host can be reached from outside without a public URL.
        StoreError: The database can't be used, or is being served already.
        EngineError: The engine doesn't start.
    """
    _require_public_url(settings)
    with ExitStack() as stack:
        listener = stack.enter_context(_listen(settings.host, settings.port))
        stack.enter_context(serve_lock(settings.database))
        store = stack.enter_context(open_store(settings.database))
        engine = DaskEngine(
            settings.n_workers,
            settings.scheduler,
            partial(warm_up, settings.study.text),
            n_training_workers=1,
        )
        stack.callback(engine.close)
        trainer = Trainer(store, engine, PERSONAL_NETWORK)
        stack.callback(trainer.close)
        populations = PopulationTrainer(store, engine, fit_population)
        stack.callback(populations.close)
        runtime = Runtime(
            store,
            engine,
            continue_session,
            test_set,
            learn,
            trainer=trainer,
            populations=populations,
        )
        accounts = DeskAccounts(store)
        parts = _parts(settings, runtime, accounts)
        for arm in settings.study.arms:
            parts.runtime.open_study(arm)
        trainer.begin_missing(settings.study.name)
        populations.begin(settings.study)
        runtime.hand_over(catch_up, store)
        stack.callback(DailyForgetting(store).close)
        addresses = _addresses(settings, listener, store, accounts)
        _favour_latency()
        server = _Server(_uvicorn_config(parts, settings), lambda: announce(addresses), parts.changes.close)
        server.run(sockets=[listener])


def _favour_latency() -> None:
    """Keeps the interpreter from holding up one person's request for the sake of throughput.

    A thread that has something to send gets the interpreter within half a millisecond instead of five. What has been
    loaded so far lives as long as the process: it is left out of garbage collection, whose full rounds, a quarter of
    a second each, become rare.
    """
    sys.setswitchinterval(0.0005)
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)


@contextmanager
def headless(
    database: str | None = None, n_workers: int = 1, scheduler: str | None = None
) -> Iterator[Runtime]:
    """Gives the services without a server.

    Args:
        database: URL of the database; a temporary one unless named.
        n_workers: Worker processes of an engine of our own; with 1, everything is computed in this process.
        scheduler: Address of a running Dask scheduler instead.

    Raises:
        StoreError: The database can't be used.
        EngineError: The engine doesn't start.
    """
    with ExitStack() as stack:
        if database is None:
            folder = stack.enter_context(TemporaryDirectory(prefix="prefstudy-"))
            database = f"sqlite:///{Path(folder) / 'headless.db'}"
        store = stack.enter_context(open_store(database))
        runtime = Runtime(
            store, _headless_engine(stack, n_workers, scheduler), continue_session, test_set, learn
        )
        stack.callback(runtime.close)
        yield runtime


def _headless_engine(stack: ExitStack, n_workers: int, scheduler: str | None) -> Engine:
    if n_workers == 1 and scheduler is None:
        return InlineEngine()
    engine = DaskEngine(n_workers, scheduler)
    stack.callback(engine.close)
    return OnDemandEngine(engine)


@contextmanager
def training(database: str, n_workers: int, scheduler: str | None = None) -> Iterator[Trainer]:
    """Gives what trains models without a server.

    Args:
        database: URL of the database.
        n_workers: Worker processes of an engine of our own; with 1, everything is computed in this process.
        scheduler: Address of a running Dask scheduler instead.

    Raises:
        StoreError: The database can't be used.
        EngineError: The engine doesn't start.
    """
    with ExitStack() as stack:
        store = stack.enter_context(open_existing_store(database))
        engine: Engine = InlineEngine()
        if n_workers > 1 or scheduler is not None:
            engine = own = DaskEngine(0, scheduler, n_training_workers=n_workers)
            stack.callback(own.close)
        trainer = Trainer(store, engine, PERSONAL_NETWORK)
        stack.callback(trainer.close)
        yield trainer


@contextmanager
def populations(store: Store) -> Iterator[PopulationTrainer]:
    """Gives what learns from all people of a study together, in this process: it takes no longer than a moment."""
    trainer = PopulationTrainer(store, InlineEngine(), fit_population)
    try:
        yield trainer
    finally:
        trainer.close()


def _parts(settings: ServeSettings, runtime: Runtime, accounts: DeskAccounts | None = None) -> SiteParts:
    changes = Changes()
    keeper = StageKeeper(lambda session_id: _picture(runtime, session_id))

    def on_change(session_id: str) -> None:
        keeper.refresh(session_id)
        changes.notify(session_id)

    reports = ReportShelf(settings.database)

    def shut_down() -> None:
        keeper.close()
        reports.close()
        runtime.close()

    runtime.on_change, runtime.on_deletion = on_change, keeper.forget

    def session_of(token: str) -> str | None:
        record = services.find(runtime, token)
        return None if record is None else record.id

    routes = stage_routes(keeper, session_of, settings.public_url)
    desk = DeskParts(
        runtime,
        settings.study,
        accounts or DeskAccounts(runtime.store),
        settings.database,
        reports,
        settings.public_url,
    )
    mounts = {"/desk": create_desk(desk), "/api/v1": create_api(desk)}
    return SiteParts(
        runtime, routes, keeper.n_viewers, changes, settings.study, settings.public_url, mounts, shut_down
    )


def _picture(runtime: Runtime, session_id: str) -> Picture | None:
    """Returns what a session's stage should show."""
    found = shown(runtime, session_id)
    if found is None:
        return None
    return Picture(found.key, *scenes(found.domain, found.query, found.first_shown), found.number)


class _Server(uvicorn.Server):
    """Announces itself when it accepts connections, and lets go of those that wait when it ends."""

    def __init__(
        self, config: uvicorn.Config, on_started: Callable[[], None], on_ending: Callable[[], None]
    ) -> None:
        super().__init__(config)
        self._on_started, self._on_ending = on_started, on_ending

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Ends the server; unlike uvicorn, doesn't raise the signal again before the engine and store are closed."""
        self.force_exit = self.should_exit and sig == signal.SIGINT
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._on_started()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._on_ending()
        await super().shutdown(sockets)


def _uvicorn_config(parts: SiteParts, settings: ServeSettings) -> uvicorn.Config:
    # No access log: paths hold participants' secret tokens.
    return uvicorn.Config(
        create_site(parts),
        access_log=False,
        log_level="warning",
        server_header=False,
        ws="websockets-sansio",
        ws_max_size=64 * 1024,
        ws_per_message_deflate=False,
        # Longer than anybody watches a pair of drives, so that an answer finds its connection open.
        timeout_keep_alive=120,
        timeout_graceful_shutdown=3,
        proxy_headers=settings.public_url is not None,
    )


def _require_public_url(settings: ServeSettings) -> None:
    if settings.host in _LOOPBACK:
        return
    if settings.public_url is None or urlsplit(settings.public_url).scheme != "https":
        raise ServeError(
            f"Expected --public-url https://... to serve on {settings.host}: links are secrets and must travel "
            "encrypted. Put a proxy with TLS in front and name its address, or use --host 127.0.0.1."
        )


@contextmanager
def _listen(host: str, port: int) -> Iterator[socket.socket]:
    try:
        listener = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET
        )
    except OSError as error:
        raise ServeError(
            f"Can't listen on {host}:{port}: {error.strerror}. Choose another --port, or 0."
        ) from error
    with listener:
        yield listener


def _addresses(
    settings: ServeSettings, listener: socket.socket, store: Store, accounts: DeskAccounts
) -> Addresses:
    host, port = listener.getsockname()[:2]
    base = settings.public_url or f"http://{f'[{host}]' if ':' in host else host}:{port}"
    base = base.rstrip("/")
    n_before = _n_of_other_versions(store, settings.study)
    return Addresses(f"{base}/join/{settings.study.name}", f"{base}/desk", accounts.setup_code, n_before)


def _n_of_other_versions(store: Store, study: Study) -> int:
    lines = store.person_lines(study.name)
    return sum(line.version != study.version and line.session.source is Source.JOINED for line in lines)
