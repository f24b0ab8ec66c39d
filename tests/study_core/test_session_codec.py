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
from study_core.events import (
    AnswerGiven,
    AnswerTakenBack,
    BreakTaken,
    FeatureLearned,
    LanguageChosen,
    PopulationAdopted,
    QueryPrepared,
    SessionBegun,
    SessionEnded,
    StepOutcome,
    StepTaken,
)
from study_core.online.feature import LearnedFeature
from study_core.path import Ending
from study_core.plan import Position
from study_core.posterior.population import PopulationPrior
from study_core.queries import Imported, ProposedQuery
from study_core.session import Phase
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
        FeatureLearned(20, 16, None, "0.1.0", "x86_64, a processor (znver4): avx2 fma"),
        dataclasses.replace(prepared(1), machine="aarch64, another (cortex-a72): neon"),
        *(prepared(index, phase) for index in range(6) for phase in Phase),
        QueryPrepared(3, Phase.TEST, ProposedQuery(proposed(1).query, IMPORTED), {}, "0.1.0", None, None),
        QueryPrepared(9, Phase.REPEAT, proposed(2), {}, "0.1.0", 1.5, Choice.B, 4),
        QueryPrepared(9, Phase.CHECK, proposed(2), {}, "0.1.0", 1.5, Choice.A, None, Position.SECOND),
        AnswerGiven(7, Choice.B, 900, 5),
        AnswerTakenBack(7),
        BreakTaken(50),
        LanguageChosen("pt-BR"),
        *(StepTaken(2, outcome) for outcome in StepOutcome),
        StepTaken(
            5,
            StepOutcome.DONE,
            {
                "read": {"language": "de"},
                "answers": {"age": 31, "drives": ["bus"], "said": 'ü 🙂\n"', "left": None},
            },
        ),
        *(SessionEnded(ending) for ending in Ending),
    ],
    ids=lambda event: type(event).__name__,
)
def test_an_event_comes_back_as_it_was(event):
    assert same(there_and_back(event), event)


@pytest.mark.parametrize("event", [prepared(1), FeatureLearned(20, 16, None, "0.1.0")])
def test_what_was_kept_before_machines_were_says_nothing_of_one(event):
    content = session_codec.to_json(dataclasses.replace(event, machine="a processor"))
    del content["machine"]
    assert same(session_codec.from_json(session_codec.kind_of(event), content), event)


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
        LanguageChosen("en"),
        StepTaken(0, StepOutcome.DONE),
        BreakTaken(4),
        AnswerTakenBack(0),
        SessionEnded(Ending.STOPPED),
    )
    kinds = [session_codec.kind_of(event) for event in events]
    assert kinds == [
        "session_begun",
        "population_adopted",
        "feature_learned",
        "query_prepared",
        "answer_given",
        "language_chosen",
        "step_taken",
        "break_taken",
        "answer_taken_back",
        "session_ended",
    ]


def test_what_the_first_sessions_did_not_say_is_not_made_up():
    content = session_codec.to_json(prepared(0))
    for key in ("first_shown", "repeat_of", "instructed"):
        del content[key]
    event = session_codec.from_json("query_prepared", content)
    assert (event.first_shown, event.repeat_of, event.instructed) == (None, None, None)
    assert event.side_shown_first is Choice.A
    answer = {"query_index": 0, "choice": "a", "response_time_ms": 5}
    assert session_codec.from_json("answer_given", answer) == AnswerGiven(0, Choice.A, 5, None)


GOOD = session_codec.to_json(prepared(0))

UNREADABLE = {
    "an unknown kind": ("session_paused", {}),
    "an end that never was": ("session_ended", {"ending": "bored"}),
    "an outcome that never was": ("step_taken", {"step": 0, "outcome": "skipped", "content": {}}),
    "a position that never was": ("query_prepared", {**GOOD, "instructed": "third"}),
    "a side that never was": ("query_prepared", {**GOOD, "first_shown": "c"}),
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
