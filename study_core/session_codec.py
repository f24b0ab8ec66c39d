"""Events of a session as JSON and back; floats keep every bit, since JSON gets the shortest text that reads back."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from study_core.comparison import Choice, Query
from study_core.errors import CheckpointError, SessionError
from study_core.events import (
    AnswerGiven,
    AnswerTakenBack,
    BreakTaken,
    Event,
    FeatureLearned,
    LanguageChosen,
    PopulationAdopted,
    QueryPrepared,
    SessionBegun,
    SessionEnded,
    SessionReopened,
    StepOutcome,
    StepTaken,
)
from study_core.networks import checkpoint
from study_core.online.feature import LearnedFeature
from study_core.path import Ending
from study_core.plan import Phase, Position
from study_core.posterior.population import PopulationPrior
from study_core.queries import Imported, ProposedQuery, Provenance

Json = dict[str, Any]

KINDS: dict[type[Event], str] = {
    SessionBegun: "session_begun",
    LanguageChosen: "language_chosen",
    StepTaken: "step_taken",
    BreakTaken: "break_taken",
    PopulationAdopted: "population_adopted",
    FeatureLearned: "feature_learned",
    QueryPrepared: "query_prepared",
    AnswerGiven: "answer_given",
    AnswerTakenBack: "answer_taken_back",
    SessionEnded: "session_ended",
    SessionReopened: "session_reopened",
}


# What the first sessions ever kept don't say about their queries.
_UNRECORDED_IN_0_1: Json = {"bank_digest": None, "visible_difference": None}


def kind_of(event: Event) -> str:
    """Returns the name under which an event is stored."""
    return KINDS[type(event)]


def to_json(event: Event) -> Json:
    """Returns an event's content as JSON values."""
    if isinstance(event, PopulationAdopted):
        return _population_to_json(event)
    if isinstance(event, FeatureLearned):
        return _feature_to_json(event)
    if isinstance(event, QueryPrepared):
        return _prepared_to_json(event)
    return {field.name: getattr(event, field.name) for field in fields(event)}


def _prepared_to_json(event: QueryPrepared) -> Json:
    return {
        "query_index": event.query_index,
        "phase": event.phase.value,
        "first_shown": event.first_shown,
        "repeat_of": event.repeat_of,
        "instructed": event.instructed,
        **proposed_to_json(event.proposed),
        "clips": dict(event.clips),
        "code_version": event.code_version,
        "machine": event.machine,
        "compute_ms": event.compute_ms,
    }


def from_json(kind: str, content: Json) -> Event:
    """Returns the event that was stored.

    Raises:
        SessionError: No event has that kind, or its content is not what this version writes.
    """
    if kind not in _READERS:
        raise SessionError(
            f"Expected an event of a known kind, got '{kind}'. Install the version that wrote it."
        )
    try:
        return _READERS[kind](content)
    except (AttributeError, KeyError, ValueError, TypeError, CheckpointError) as error:
        raise SessionError(
            f"A stored event '{kind}' can't be read: {error!r}. Was it written by this version?"
        ) from error


def _population_to_json(event: PopulationAdopted) -> Json:
    population = event.population
    return {
        "query_index": event.query_index,
        "key": event.key,
        "learned_from": list(event.learned_from),
        "population": None if population is None else population_to_json(population),
    }


def _population_adopted(content: Json) -> PopulationAdopted:
    population = content["population"]
    return PopulationAdopted(
        content["query_index"],
        content["key"],
        tuple(content["learned_from"]),
        None if population is None else population_from_json(population),
    )


def population_to_json(population: PopulationPrior) -> Json:
    """Returns what people have in common as JSON values."""
    return _plain(population)


def population_from_json(content: Json) -> PopulationPrior:
    """Returns what `population_to_json` wrote."""
    return PopulationPrior(**_arrays(content))


def _feature_to_json(event: FeatureLearned) -> Json:
    return {
        "query_index": event.query_index,
        "n_queries": event.n_queries,
        "feature": None if event.feature is None else _learned_to_json(event.feature),
        "code_version": event.code_version,
        "machine": event.machine,
    }


def _feature_learned(content: Json) -> FeatureLearned:
    feature = content["feature"]
    return FeatureLearned(
        content["query_index"],
        content["n_queries"],
        None if feature is None else _learned(feature),
        content["code_version"],
        content.get("machine"),
    )


def _learned_to_json(feature: LearnedFeature) -> Json:
    return {
        "checkpoint": base64.b64encode(checkpoint.to_bytes(feature.checkpoint)).decode(),
        "n_learned_from": feature.n_learned_from,
        "drives": feature.drives.tolist(),
        "drive_weights": feature.drive_weights.tolist(),
    }


def _learned(content: Json) -> LearnedFeature:
    networks = checkpoint.from_bytes(base64.b64decode(content["checkpoint"]))
    drives = _arrays({key: content[key] for key in ("drives", "drive_weights")})
    return LearnedFeature(networks, content["n_learned_from"], **drives)


def _query_prepared(content: Json) -> QueryPrepared:
    return QueryPrepared(
        content["query_index"],
        Phase(content["phase"]),
        proposed_from_json(content),
        dict(content["clips"]),
        content["code_version"],
        content["compute_ms"],
        # The first sessions ever kept don't say it; they showed A first.
        _choice(content.get("first_shown")),
        content.get("repeat_of"),
        None if content.get("instructed") is None else Position(content["instructed"]),
        content.get("machine"),
    )


def _choice(value: str | None) -> Choice | None:
    return None if value is None else Choice(value)


def _answer_given(content: Json) -> AnswerGiven:
    confidence = content.get("confidence")
    return AnswerGiven(
        content["query_index"], Choice(content["choice"]), content["response_time_ms"], confidence
    )


def _step_taken(content: Json) -> StepTaken:
    return StepTaken(content["step"], StepOutcome(content["outcome"]), dict(content["content"]))


_READERS: dict[str, Callable[[Json], Event]] = {
    "session_begun": lambda content: SessionBegun(content["participant"]),
    "language_chosen": lambda content: LanguageChosen(content["language"]),
    "step_taken": _step_taken,
    "break_taken": lambda content: BreakTaken(content["query_index"]),
    "population_adopted": _population_adopted,
    "feature_learned": _feature_learned,
    "query_prepared": _query_prepared,
    "answer_given": _answer_given,
    "answer_taken_back": lambda content: AnswerTakenBack(content["query_index"]),
    "session_reopened": lambda content: SessionReopened(),
    "session_ended": lambda content: SessionEnded(Ending(content["ending"])),
}


def proposed_to_json(proposed: ProposedQuery) -> Json:
    """Returns a query and its provenance as JSON values."""
    return {"query": _plain(proposed.query), "provenance": _plain(proposed.provenance)}


def proposed_from_json(content: Json) -> ProposedQuery:
    """Returns what `proposed_to_json` wrote."""
    return ProposedQuery(query_from_json(content["query"]), provenance_from_json(content["provenance"]))


def test_set_to_bytes(test_set: tuple[ProposedQuery, ...]) -> bytes:
    """Returns a common test set as JSON text."""
    return json.dumps([proposed_to_json(proposed) for proposed in test_set]).encode()


def test_set_from_bytes(content: bytes) -> tuple[ProposedQuery, ...]:
    """Returns what `test_set_to_bytes` wrote."""
    return tuple(proposed_from_json(item) for item in json.loads(content))


def query_from_json(content: Json) -> Query:
    """Returns a query from its JSON values."""
    return Query(**_arrays(content))


def provenance_from_json(content: Json) -> Provenance | Imported:
    """Returns a query's provenance from its JSON values; only an imported query's names a file."""
    if "file" in content:
        return Imported(**content)
    content = {**_UNRECORDED_IN_0_1, **content}
    weights = {key: content[key] for key in ("weights_a", "weights_b")}
    arrays = {
        key: None if value is None else np.array(value, dtype=np.float64) for key, value in weights.items()
    }
    tuples = {key: tuple(content[key]) for key in ("stream", "versions", "has_converged")}
    return Provenance(**{**content, **arrays, **tuples})


def _arrays(content: Json) -> dict[str, Any]:
    return {key: np.array(value, dtype=np.float64) for key, value in content.items()}


def _plain(record: Query | Provenance | Imported | PopulationPrior) -> Json:
    """Returns a flat dataclass as JSON values."""
    return {field.name: _plain_value(getattr(record, field.name)) for field in fields(record)}


def _plain_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value
