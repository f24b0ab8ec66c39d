"""What the people of a study have in common: learned whenever somebody finishes, and where the next one starts from.

A model is named by a hash of its version and the answers. It is never out of date for long: whoever finishes, and
whoever is deleted, has it learned again. Answers to test queries can't be reached from here; see `app.services.people`.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from threading import Lock
from typing import Any, Protocol

from app.services.computations import hand_over
from app.services.continuation import Computation, Engine
from app.services.people import ActiveAnswers, is_finished, person, study_of
from app.store.desk_records import Review
from app.store.errors import SessionDeletedError
from app.store.records import ModelRecord, SessionRecord, Source
from study_core import session_codec
from study_core.events import PopulationAdopted
from study_core.predictors.hand_coded_population import VERSION
from study_core.predictors.linear_people import ComparedFeatures
from study_core.study import Study

KIND = "population"

log = logging.getLogger(__name__)

# Whatever a person waits for, or may soon wait for, comes first; one who begins may wait for this before a network.
_URGENCY = -5.0


@dataclass(frozen=True)
class PopulationRequest:
    """Everything that what people have in common depends on.

    Attributes:
        domain_id: Whose trajectories were compared.
        people: Each person's active answers in the domain's hand-coded features, by session id.
    """

    domain_id: str
    people: Mapping[str, ComparedFeatures]

    @cached_property
    def key(self) -> str:
        """Returns the name of the computation: equal requests are computed once, and none goes stale."""
        digest = hashlib.sha256(json.dumps([VERSION, self.domain_id, list(self.people)]).encode())
        for compared in self.people.values():
            for values in (compared.of_a, compared.of_b, compared.signs):
                digest.update(values.tobytes())
        return f"{KIND}-{digest.hexdigest()}"


FitFn = Callable[[PopulationRequest], bytes]
"""Learns what people have in common: pure, importable by name in another process; gives it as bytes to be stored."""


class SharedModels(Protocol):
    """The part of a `Store` that knows what was learned from several people."""

    def shared_model(self, study_name: str, kind: str) -> ModelRecord | None:
        """See `Store`."""
        ...


class PopulationStore(ActiveAnswers, SharedModels, Protocol):
    """The part of a `Store` that learning what people have in common uses."""

    def sessions(self) -> list[SessionRecord]:
        """See `Store`."""
        ...

    def sessions_of_study_named(self, name: str) -> list[SessionRecord]:
        """See `Store`."""
        ...

    def reviews_against(self, study_name: str) -> dict[str, Review]:
        """See `Store`."""
        ...

    def put_shared_model(self, study_name: str, model: ModelRecord, session_ids: list[str]) -> None:
        """See `Store`."""
        ...


def adopted(models: SharedModels, study: Study) -> PopulationAdopted | None:
    """Returns what somebody who begins now starts from; None without people before, or where the study wants none.

    It may not know yet who has finished just now; whoever has been deleted isn't in it.
    """
    if not study.file.learning.people_before:
        return None
    model = models.shared_model(study.name, KIND)
    if model is None or (model.lineage["version"], model.lineage["domain"]) != (VERSION, study.domain.id):
        return None
    population = session_codec.population_from_json(json.loads(model.content))
    return PopulationAdopted(0, model.key, tuple(model.lineage["sessions"]), population)


class PopulationTrainer:
    """Sees to it that each study that starts from the people before knows all who have finished, rehearsed ones apart.

    One study is learned at a time. Whoever finishes meanwhile is waited for by one more run, not by one each.
    """

    def __init__(self, store: PopulationStore, engine: Engine, fit: FitFn) -> None:
        """Joins the parts, which belong to the caller.

        Args:
            store: Where answers are, and models go.
            engine: Where models are learned.
            fit: How.
        """
        self._store = store
        self._engine = engine
        self._fit = fit
        self._lock = Lock()
        # Studies of which somebody has finished since they were last looked at, and those being learned; by name.
        self._wanted: dict[str, Study] = {}
        self._under_way: set[str] = set()
        self._known_of: dict[str, dict[str, ComparedFeatures]] = {}
        self._background = ThreadPoolExecutor(1, thread_name_prefix="population")

    def close(self) -> None:
        """Waits for what is just being read or stored; what was to come is found again by the next process."""
        self._background.shutdown(wait=True, cancel_futures=True)

    def begin(self, study: Study) -> None:
        """Starts learning what people of a study have in common, unless it is known; returns at once."""
        if not study.file.learning.people_before:
            return
        with self._lock:
            self._wanted[study.name] = study
            if study.name in self._under_way:
                return
            self._under_way.add(study.name)
        self._in_background(lambda: self._go_on(study.name))

    def missing(self, study_name: str | None = None) -> list[Study]:
        """Returns the studies that start from the people before and don't know all of them, in their newest version.

        Args:
            study_name: The study; None for all.
        """
        records = (
            self._store.sessions() if study_name is None else self._store.sessions_of_study_named(study_name)
        )
        newest = {study.name: study for study in (study_of(self._store, record) for record in records)}
        return [
            study
            for study in newest.values()
            if study.file.learning.people_before and self._request(study) is not None
        ]

    def fit(self, study: Study) -> int:
        """Learns what the people of a study have in common, and waits for it.

        Returns:
            How many people were learned from; 0 if nobody has finished, or all were known.
        """
        while (request := self._request(study)) is not None:
            content: bytes = self._submit(request).result()
            if self._keep(study, request, content):
                return len(request.people)
        return 0

    def _in_background(self, task: Callable[[], object]) -> None:
        hand_over(self._background, task)

    def _go_on(self, name: str) -> None:
        """Learns a study if somebody is still waited for."""
        with self._lock:
            study = self._wanted.pop(name, None)
            if study is None:
                self._under_way.discard(name)
                return
        try:
            request = self._request(study)
        except SessionDeletedError:
            # Somebody went while their answers were read.
            self._again(study)
            return
        except Exception:
            log.exception("study %s: what its people have in common could not be begun", name)
            request = None
        if request is None:
            self._go_on(name)
            return
        computation = self._submit(request)
        arrived = partial(self._arrived, study, request, computation)
        computation.add_done_callback(lambda _: self._in_background(arrived))

    def _arrived(self, study: Study, request: PopulationRequest, computation: Computation) -> None:
        try:
            is_kept = self._keep(study, request, computation.result())
        except Exception:
            log.exception("study %s: what its people have in common could not be learned", study.name)
            is_kept = True
        if is_kept:
            self._go_on(study.name)
        else:
            self._again(study)

    def _again(self, study: Study) -> None:
        with self._lock:
            self._wanted.setdefault(study.name, study)
        self._go_on(study.name)

    def _submit(self, request: PopulationRequest) -> Computation:
        return self._engine.submit(request.key, self._fit, request, _URGENCY, resource="training")

    def _request(self, study: Study) -> PopulationRequest | None:
        """Returns what is to be computed for a study, if anything is."""
        known = self._known(study)
        if not any(len(compared) for compared in known.values()):
            return None
        request = PopulationRequest(study.domain.id, known)
        model = self._store.shared_model(study.name, KIND)
        return None if model is not None and model.key == request.key else request

    def _known(self, study: Study) -> dict[str, ComparedFeatures]:
        """Returns what everyone compared who has finished in the domain that the study has now, and counts.

        Each is read once, since what somebody has finished never changes; whoever is deleted is forgotten.
        """
        before, known = self._known_of.get(study.name, {}), {}
        against = self._store.reviews_against(study.name)
        for record in self._store.sessions_of_study_named(study.name):
            if record.id in against:
                continue
            if record.id in before:
                known[record.id] = before[record.id]
            elif self._counts(study, record):
                learner = person(self._store, record)
                known[record.id] = ComparedFeatures.of(study.domain.features, learner.training)
        self._known_of[study.name] = known
        return known

    def _counts(self, study: Study, record: SessionRecord) -> bool:
        if record.source is Source.REHEARSED or not is_finished(self._store, record):
            return False
        return study_of(self._store, record).domain.id == study.domain.id

    def _keep(self, study: Study, request: PopulationRequest, content: bytes) -> bool:
        """Stores a model; returns False if somebody whom it knows was deleted meanwhile."""
        session_ids = list(request.people)
        model = ModelRecord(KIND, request.key, content, _lineage(request))
        try:
            self._store.put_shared_model(study.name, model, session_ids)
        except SessionDeletedError:
            log.info("study %s: somebody was deleted while they were learned from", study.name)
            return False
        return True


def _lineage(request: PopulationRequest) -> dict[str, Any]:
    return {
        "sessions": list(request.people),
        "version": VERSION,
        "domain": request.domain_id,
        "n_answers": sum(len(compared) for compared in request.people.values()),
    }
