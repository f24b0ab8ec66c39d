"""Events survive JSON to the last bit."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from study_core import session_codec
from study_core.comparison import Choice, Query
from study_core.errors import SessionError
from study_core.online.feature import LearnedFeature
from study_core.posterior.population import PopulationPrior
from study_core.queries import Imported, ProposedQuery
from study_core.session import (
    AnswerGiven,
    FeatureLearned,
    Phase,
    PopulationAdopted,
    QueryPrepared,
    SessionBegun,
)
from tests.study_core.made_up import learned_feature, prepared, proposed

IMPORTED = Imported("test10.jld2", "5a" * 32, 74)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
ROWS = arrays(np.float64, 4, elements=FLOATS)


def there_and_back(event):
    text = json.dumps(session_codec.to_json(event))
    return session_codec.from_json(session_codec.kind_of(event), json.loads(text))


def same(first, second):
    """Equality of type and value, all the way down; arrays bit for bit, signs of zero included."""
    if type(first) is not type(second):
        return False
    if isinstance(first, LearnedFeature):
        return first == second
    if dataclasses.is_dataclass(first):
        return all(
            same(getattr(first, field.name), getattr(second, field.name))
            for field in dataclasses.fields(first)
        )
    if isinstance(first, np.ndarray):
        return (
            first.dtype == second.dtype
            and first.shape == second.shape
            and first.tobytes() == second.tobytes()
        )
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(same, first, second))
    return first == second


@pytest.mark.parametrize(
    "event",
    [
        SessionBegun(12),
        SessionBegun("rehearsal"),
        AnswerGiven(7, Choice.A, 0),
        *(AnswerGiven(0, choice, 86_400_000) for choice in Choice),
        AnswerGiven(0, Choice.A, None),
        PopulationAdopted(
            0, "population-1f", ("one", "two"), PopulationPrior(np.arange(4.0) / 3, np.eye(4) / 7)
        ),
        PopulationAdopted(0, "population-1f", ("one",), None),
        FeatureLearned(20, 16, learned_feature(), "0.1.0"),
        FeatureLearned(20, 16, None, "0.1.0"),
        *(prepared(index, phase) for index in range(6) for phase in Phase),
        QueryPrepared(3, Phase.TEST, ProposedQuery(proposed(1).query, IMPORTED), {}, "0.1.0", None, None),
    ],
    ids=lambda event: type(event).__name__,
)
def test_an_event_comes_back_as_it_was(event):
    assert same(there_and_back(event), event)


@given(controls_a=ROWS, controls_b=ROWS, features_a=ROWS, features_b=ROWS, score=FLOATS, compute_ms=FLOATS)
def test_every_float_keeps_every_bit(controls_a, controls_b, features_a, features_b, score, compute_ms):
    given = proposed(1)
    event = QueryPrepared(
        1,
        Phase.ACTIVE,
        dataclasses.replace(
            given,
            query=Query(controls_a, controls_b, features_a, features_b),
            provenance=dataclasses.replace(given.provenance, score=score, weights_a=features_a),
        ),
        {},
        "0.1.0",
        compute_ms,
        Choice.B,
    )
    assert same(there_and_back(event), event)


@pytest.mark.parametrize("value", [-0.0, 5e-324, math.nextafter(1.0, 2.0), 0.1 + 0.2, 1.7976931348623157e308])
def test_awkward_floats_keep_every_bit(value):
    row = np.array([value, -value])
    query = Query(row, row, row, row)
    assert same(session_codec.query_from_json(json.loads(json.dumps(session_codec._plain(query)))), query)


def test_a_test_set_comes_back_as_it_was():
    test_set = tuple(proposed(index) for index in range(4))
    content = session_codec.test_set_to_bytes(test_set)
    assert same(session_codec.test_set_from_bytes(content), test_set)
    assert session_codec.test_set_from_bytes(session_codec.test_set_to_bytes(())) == ()


def test_every_kind_of_event_has_a_name_of_its_own():
    events = (
        SessionBegun(1),
        PopulationAdopted(0, "key", ("one",), None),
        FeatureLearned(20, 16, None, "0.1.0"),
        prepared(0),
        AnswerGiven(0, Choice.A, 1),
    )
    kinds = [session_codec.kind_of(event) for event in events]
    assert kinds == [
        "session_begun",
        "population_adopted",
        "feature_learned",
        "query_prepared",
        "answer_given",
    ]


GOOD = session_codec.to_json(prepared(0))

UNREADABLE = {
    "an unknown kind": ("session_ended", {}),
    "a beginning of nobody": ("session_begun", {}),
    "an answer without a choice": ("answer_given", {"query_index": 0, "response_time_ms": 5}),
    "an answer neither a nor b": ("answer_given", {"query_index": 0, "choice": "c", "response_time_ms": 5}),
    "a feature of other bytes": (
        "feature_learned",
        {
            "query_index": 20,
            "n_queries": 16,
            "feature": {"checkpoint": "AAAA", "n_learned_from": 16, "drives": [], "drive_weights": []},
            "code_version": "0.1.0",
        },
    ),
    "a population without numbers": (
        "population_adopted",
        {"query_index": 0, "key": "k", "learned_from": [], "population": {"mean": [1.0]}},
    ),
    "a query without numbers": ("query_prepared", {**GOOD, "query": {}}),
    "a query that is a list": ("query_prepared", {**GOOD, "query": [1, 2]}),
    "a query of texts": ("query_prepared", {**GOOD, "query": {**GOOD["query"], "controls_a": ["x"]}}),
    "a query with a key too many": (
        "query_prepared",
        {**GOOD, "query": {**GOOD["query"], "controls_c": [1.0]}},
    ),
    "a query without provenance": ("query_prepared", {key: GOOD[key] for key in GOOD if key != "provenance"}),
    "provenance with a key too few": (
        "query_prepared",
        {**GOOD, "provenance": {key: value for key, value in GOOD["provenance"].items() if key != "score"}},
    ),
    "an imported query from nowhere": ("query_prepared", {**GOOD, "provenance": {"file": "train1.jld2"}}),
    "a phase that never was": ("query_prepared", {**GOOD, "phase": "warm-up"}),
    "no clips": ("query_prepared", {**GOOD, "clips": None}),
}


@pytest.mark.parametrize("case", UNREADABLE)
def test_what_this_version_never_wrote_is_refused_by_name(case):
    kind, content = UNREADABLE[case]
    with pytest.raises(SessionError, match=kind):
        session_codec.from_json(kind, content)
