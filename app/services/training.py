"""What is learned from a person once their session is finished: computed by the engine, kept when it arrives.

Nobody waits for it, and nothing of it is precious: whatever is missing is found and trained again. A model is named by
a hash of the method, its settings and the answers. Answers to test queries can't be reached from here; see
`app.services.people`.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Protocol

from app.errors import AppError
from app.services.computations import hand_over
from app.services.continuation import Computation, Engine
from app.services.people import ActiveAnswers, is_finished, person
from app.store.errors import SessionDeletedError
from app.store.records import ModelRecord, SessionRecord, Source
from study_core.predictors.predictor import Training
from study_core.queries import Participant

log = logging.getLogger(__name__)

# Whatever a person waits for, or may soon wait for, comes first.
_URGENCY = -10.0


@dataclass(frozen=True)
class TrainingRequest:
    """Everything that a personal model depends on.

    Attributes:
        kind: Which predictor it is for, such as `personal-network`.
        version: Version of the function that trains it; changed numbers are a new version.
        settings: JSON: what may be set in that function.
        domain_id: Whose trajectories were compared.
        seed: The study's.
        participant: Names the random streams, together with the seed and the kind.
        training: What the person's active answers taught.
    """

    kind: str
    version: str
    settings: Mapping[str, Any]
    domain_id: str
    seed: int
    participant: Participant
    training: Training

    @cached_property
    def key(self) -> str:
        """Returns the name of the computation: equal requests are computed once, and none goes stale."""
        named = (self.kind, self.version, self.settings, self.domain_id, self.seed, self.participant)
        digest = hashlib.sha256(json.dumps(named, sort_keys=True).encode())
        mean = self.training.stored_mean
        for values in (self.training.pairs.states_a, self.training.pairs.states_b, self.training.signs, mean):
            digest.update(b"none" if values is None else values.tobytes())
        return f"{self.kind}-{digest.hexdigest()}"


TrainFn = Callable[[TrainingRequest], bytes]
"""Trains one person's model: pure, importable by name in another process; gives the model as bytes to be stored."""


@dataclass(frozen=True)
class TrainingMethod:
    """A way to learn from one person.

    Attributes:
        kind: What the models are called in the store.
        version: Version of `train`.
        settings: JSON: what may be set in it.
        fewest_answers: Nothing is learned from somebody with fewer active answers.
        train: Trains a model.
    """

    kind: str
    version: str
    settings: Mapping[str, Any]
    fewest_answers: int
    train: TrainFn


class TrainingStore(ActiveAnswers, Protocol):
    """The part of a `Store` that training uses."""

    def session(self, session_id: str) -> SessionRecord:
        """See `Store`."""
        ...

    def sessions(self) -> list[SessionRecord]:
        """See `Store`."""
        ...

    def sessions_of_study_named(self, name: str) -> list[SessionRecord]:
        """See `Store`."""
        ...

    def personal_model_key(self, session_id: str, kind: str) -> str | None:
        """See `Store`."""
        ...

    def put_personal_model(self, session_id: str, model: ModelRecord) -> None:
        """See `Store`."""
        ...


class TrainingError(AppError):
    """Models that could not be trained."""


@dataclass(frozen=True)
class _Begun:
    """A model on its way."""

    session_id: str
    request: TrainingRequest
    computation: Computation


class Trainer:
    """Sees to it that everyone who has finished gets a model; rehearsed people apart."""

    def __init__(self, store: TrainingStore, engine: Engine, method: TrainingMethod) -> None:
        """Joins the parts, which belong to the caller.

        Args:
            store: Where answers are, and models go.
            engine: Where models are trained.
            method: How.
        """
        self._store = store
        self._engine = engine
        self._method = method
        self._background = ThreadPoolExecutor(1, thread_name_prefix="training")

    def close(self) -> None:
        """Waits for what is just being read or stored; what was to come is found again by the next process."""
        self._background.shutdown(wait=True, cancel_futures=True)

    def begin(self, session_id: str) -> None:
        """Starts training the model of a person who has just finished; returns at once."""
        self._in_background(self._begin_one, session_id)

    def begin_missing(self, study_name: str) -> None:
        """Starts training the model of everyone in a study who has finished and has none; returns at once."""
        self._in_background(self._begin_all, study_name)

    def missing(self, study_name: str | None = None) -> list[SessionRecord]:
        """Returns whoever can be learned from and has no model, or one of other answers, settings or version.

        Args:
            study_name: The study; None for all.
        """
        records = (
            self._store.sessions() if study_name is None else self._store.sessions_of_study_named(study_name)
        )
        return [record for record in records if self._request(record) is not None]

    def train(self, records: Iterable[SessionRecord], on_person: Callable[[], None]) -> None:
        """Trains the models of these people and waits for them.

        Args:
            records: Of whom; who has a model already is left alone.
            on_person: Called after each person.

        Raises:
            TrainingError: Some could not be trained; the others are stored, and the log says why.
        """
        begun = [self._begun(record) for record in records]
        n_failed = 0
        for training in begun:
            n_failed += training is not None and not self._keep(training)
            on_person()
        if n_failed:
            raise TrainingError(
                f"{n_failed} of {len(begun)} models could not be trained; the log above says why."
            )

    def _in_background(self, task: Callable[[str], object], name: str) -> None:
        hand_over(self._background, _reporting, task, name)

    def _begin_all(self, study_name: str) -> None:
        for record in self.missing(study_name):
            self._begin_one(record.id)

    def _begin_one(self, session_id: str) -> None:
        training = self._begun(self._store.session(session_id))
        if training is not None:
            keep = partial(self._in_background, lambda _: self._keep(training), session_id)
            training.computation.add_done_callback(lambda _: keep())

    def _begun(self, record: SessionRecord) -> _Begun | None:
        request = self._request(record)
        if request is None:
            return None
        computation = self._engine.submit(
            request.key, self._method.train, request, _URGENCY, resource="training"
        )
        return _Begun(record.id, request, computation)

    def _request(self, record: SessionRecord) -> TrainingRequest | None:
        """Returns what is to be computed for a person, if anything is."""
        if record.source is Source.REHEARSED or not is_finished(self._store, record):
            return None
        known, method = person(self._store, record), self._method
        if len(known.training) < method.fewest_answers:
            return None
        assert known.participant is not None, "whoever has finished has begun"
        request = TrainingRequest(
            method.kind,
            method.version,
            method.settings,
            known.study.domain.id,
            known.study.seed,
            known.participant,
            known.training,
        )
        has_it = self._store.personal_model_key(record.id, method.kind) == request.key
        return None if has_it else request

    def _keep(self, training: _Begun) -> bool:
        """Stores a model; returns whether there was one to store."""
        session_id, request = training.session_id, training.request
        try:
            content: bytes = training.computation.result()
        except CancelledError:
            return False
        except Exception:
            log.exception("session %s: its %s could not be trained", session_id, request.kind)
            return False
        model = ModelRecord(request.kind, request.key, content, _lineage(session_id, request))
        try:
            self._store.put_personal_model(session_id, model)
        except SessionDeletedError:
            log.info("session %s was deleted while its %s was trained", session_id, request.kind)
        return True


def _lineage(session_id: str, request: TrainingRequest) -> dict[str, Any]:
    return {
        "sessions": [session_id],
        "version": request.version,
        "settings": dict(request.settings),
        "domain": request.domain_id,
        "seed": request.seed,
        "participant": request.participant,
        "n_answers": len(request.training),
    }


def _reporting(task: Callable[[str], object], name: str) -> None:
    """Runs a task that nobody waits for; what makes it fail goes to the log."""
    try:
        task(name)
    except SessionDeletedError:
        log.info("session %s was deleted before it was learned from", name)
    except Exception:
        log.exception("%s: training could not be begun", name)
