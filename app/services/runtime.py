"""What the services of one process share: the store, the engine, and the sessions that are live here."""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from app.services.computations import hand_over
from app.services.continuation import Computation, ContinueFn, Engine, FeatureRequest, LearnFn, TestSetFn
from app.services.health import Health
from app.services.population import PopulationTrainer
from app.services.standing import exclusion_after, standing_of
from app.services.training import Trainer
from app.store import NewEvent, NewReport, PosteriorRecord, SessionDeletedError, SessionRecord, Store
from study_core import session_codec
from study_core.comparison import Choice
from study_core.events import Event
from study_core.queries import ProposedQuery
from study_core.session import SessionState, apply, reduce
from study_core.study import Study, parse_study

_MOST_LIVE_SESSIONS = 2000

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class OpenStudy:
    """A study in use: its definition and its common test set."""

    study: Study
    test_set: tuple[ProposedQuery, ...]


@dataclass
class LiveSession:
    """A session that this process has read: its state, and what is being computed for it.

    Everything but `record` and `opened` is guarded by `lock`.

    Attributes:
        record: The stored session.
        opened: Its study.
        state: Its log, reduced.
        ahead: The continuation after each possible answer to the current query; under None, one that doesn't depend
            on an answer.
        learning: The feature that is being learned, and from what.
        moved_on_at: When the log last grew here, on the monotonic clock.
    """

    record: SessionRecord
    opened: OpenStudy
    state: SessionState
    ahead: dict[Choice | None, Computation] = field(default_factory=dict)
    learning: tuple[FeatureRequest, Computation] | None = None
    moved_on_at: float = field(default_factory=time.monotonic)
    lock: threading.RLock = field(default_factory=threading.RLock)

    @property
    def study(self) -> Study:
        """Returns the study that the session was created under."""
        return self.opened.study


class Runtime:
    """Resources of the services. Nothing in it is precious: all of it can be read again from the store."""

    def __init__(
        self,
        store: Store,
        engine: Engine,
        continue_fn: ContinueFn,
        test_set_fn: TestSetFn,
        learn_fn: LearnFn,
        on_change: Callable[[str], None] = lambda session_id: None,
        on_deletion: Callable[[str], None] = lambda session_id: None,
        trainer: Trainer | None = None,
        populations: PopulationTrainer | None = None,
    ) -> None:
        """Joins the parts.

        Args:
            store: Where events go.
            engine: Where continuations are computed.
            continue_fn: Computes a continuation.
            test_set_fn: Computes a study's common test set.
            learn_fn: Learns a feature from a session's own answers.
            on_change: Told the id of a session whose log has grown, after it is durable.
            on_deletion: Told the id of a session that is no more.
            trainer: Learns from whoever has finished; None where nobody is to be learned from.
            populations: Learns what they have in common; None where nobody is to be learned from.
        """
        self.store = store
        self.engine = engine
        self.continue_fn = continue_fn
        self.learn_fn = learn_fn
        self.on_change = on_change
        self.on_deletion = on_deletion
        self.trainer = trainer
        self.populations = populations
        self.health = Health()
        self.background = ThreadPoolExecutor(max_workers=4, thread_name_prefix="services")
        self._test_set_fn = test_set_fn
        self._studies: dict[str, OpenStudy] = {}
        self._live: OrderedDict[str, LiveSession] = OrderedDict()
        self._by_token: OrderedDict[str, SessionRecord] = OrderedDict()
        self._lock = threading.RLock()

    def close(self) -> None:
        """Waits for background work; the store, the engine and the trainer belong to the caller."""
        self.background.shutdown(wait=True)

    def hand_over(self, function: Callable[..., object], *arguments: object) -> None:
        """Runs a function soon, in the background; see `app.services.computations`."""
        hand_over(self.background, function, *arguments)

    def open_study(self, study: Study) -> OpenStudy:
        """Stores a study, and computes its test set unless it is stored already."""
        with self._lock:
            if study.hash not in self._studies:
                self.store.put_study(study.hash, study.name, study.text, study.version, study.condition)
                self._studies[study.hash] = OpenStudy(study, self._test_set(study))
            return self._studies[study.hash]

    def _test_set(self, study: Study) -> tuple[ProposedQuery, ...]:
        key = f"test-set-{study.hash}"
        stored = self.store.artifact(key)
        if stored is None:
            computed = self.engine.submit(key, self._test_set_fn, study.text, urgency=1.0).result()
            self.store.put_artifact(key, "test_set", session_codec.test_set_to_bytes(computed))
            return tuple(computed)
        return session_codec.test_set_from_bytes(stored)

    def live(self, session_id: str) -> LiveSession:
        """Returns a session with its state, read from the store unless it is live already."""
        with self._lock:
            known = self._live.get(session_id)
            if known is not None:
                self._live.move_to_end(session_id)
                return known
        # Reading a long log takes a while, and nobody else has to wait for it; whoever is first keeps theirs.
        try:
            read = self._read(session_id)
        except SessionDeletedError:
            # Another process has deleted it.
            self.forget(session_id)
            raise
        with self._lock:
            if len(self._live) >= _MOST_LIVE_SESSIONS:
                self._live.popitem(last=False)
            return self._live.setdefault(session_id, read)

    def known_session(self, token_hash: str) -> SessionRecord | None:
        """Returns the session that a token opens if it has been asked for before; never waits."""
        return self._by_token.get(token_hash)

    def session_of_token(self, token_hash: str) -> SessionRecord | None:
        """Returns the session that a token opens, read from the store once: every request asks."""
        known = self.known_session(token_hash)
        if known is not None:
            return known
        found = self.store.session_by_token(token_hash)
        if found is not None:
            with self._lock:
                if len(self._by_token) >= _MOST_LIVE_SESSIONS:
                    self._by_token.popitem(last=False)
                self._by_token[token_hash] = found
        return found

    def forget(self, session_id: str) -> None:
        """Lets go of a session that was deleted, and of what is being computed for it."""
        with self._lock:
            live = self._live.pop(session_id, None)
            for token_hash in [key for key, known in self._by_token.items() if known.id == session_id]:
                del self._by_token[token_hash]
        if live is not None:
            learning = () if live.learning is None else (live.learning[1],)
            for computation in (*live.ahead.values(), *learning):
                computation.cancel()
        self.on_deletion(session_id)

    def _read(self, session_id: str) -> LiveSession:
        record = self.store.session(session_id)
        study = parse_study(self.store.study_text(record.study_hash))
        return LiveSession(record, self.open_study(study), self._stored_state(study, session_id))

    def events(self, session_id: str) -> Iterator[Event]:
        """Gives the stored log of a session."""
        return (session_codec.from_json(e.kind, e.payload) for e in self.store.events(session_id))

    def _stored_state(self, study: Study, session_id: str) -> SessionState:
        return reduce(study, self.events(session_id))

    def append(
        self,
        live: LiveSession,
        events: list[Event],
        posterior: PosteriorRecord | None = None,
        report: NewReport | None = None,
    ) -> None:
        """Appends events durably and moves the live state on; the caller holds the session's lock.

        Raises:
            PositionTakenError: Another process wrote first, or somebody was deleted whom the session's start was
                learned from; the live state has been read again.
            SessionDeletedError: The session is gone; so is what was known of it here.
        """
        state = live.state
        for event in events:
            state = apply(live.study, state, event)
        new = [NewEvent(session_codec.kind_of(event), session_codec.to_json(event)) for event in events]
        standing = standing_of(live.study, state, events, posterior, report)
        try:
            goes_on_from_people = live.state.knowledge.population is not None
            self.store.append(
                live.record.id,
                live.state.n_events,
                new,
                posterior,
                report,
                goes_on_from_people,
                state.ending,
                standing,
                exclusion_after(live.study, state),
            )
        except SessionDeletedError:
            self.forget(live.record.id)
            raise
        except Exception:
            live.state, live.ahead = self._stored_state(live.study, live.record.id), {}
            raise
        now = time.monotonic()
        if standing.is_wait:
            self.health.waited(now - live.moved_on_at)
        live.state, live.moved_on_at = state, now
