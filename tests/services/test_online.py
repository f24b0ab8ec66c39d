"""A session learns a feature from its own answers and goes on with it; its log says when, from what, and with what."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app import wiring
from app.services import study as services
from app.services.continuation import FeatureRequest
from app.services.export import ExportOptions, export, open_export
from app.services.learning import feature_before
from app.services.rehearsal import Rehearsal, rehearse
from app.services.rehearsed_person import Crowd
from app.services.replay import ReplayDifferenceError, derive, people_of
from app.services.runtime import Runtime
from app.services.study import Outcome
from app.services.walk import walk
from app.settings import find_study
from study_core.comparison import Choice, ComparisonSet
from study_core.events import AnswerGiven, FeatureLearned
from study_core.learning import compared
from study_core.online.feature import Compared
from study_core.online.learn import learn_feature
from study_core.participants import Habits
from study_core.plan import Phase
from study_core.session_codec import from_json
from study_core.study import Study, parse_study

BOTH_SIDES = Crowd(4, 1, Habits(hidden_feature="side", hidden_weight=1.0), rationality=100.0, lapse_rate=0.02)


def online(*replacements: tuple[str, str]) -> Study:
    text = find_study("online").text
    for old, new in (
        ("active_queries = 60 ", "active_queries = 20 "),
        ("test_queries = 40 ", "test_queries = 2 "),
        ("feature_every = 20 ", "feature_every = 15 "),
        *replacements,
    ):
        assert old in text
        text = text.replace(old, new)
    return parse_study(text)


STUDY = online()


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Runtime, Rehearsal]]:
    url = f"sqlite:///{tmp_path_factory.mktemp('online') / 'online.db'}"
    with wiring.headless(url) as runtime:
        yield runtime, rehearse(runtime, STUDY, BOTH_SIDES, 1, lambda: None)


def test_the_log_says_when_a_feature_came_and_from_how_many_queries(
    rehearsed: tuple[Runtime, Rehearsal],
) -> None:
    runtime, _ = rehearsed
    (record,) = runtime.store.sessions()
    events = list(runtime.events(record.id))
    learned = [(event.query_index, event.n_queries) for event in events if isinstance(event, FeatureLearned)]
    assert learned == [(15, 11)]


def test_posteriors_have_one_weight_more_from_then_on(rehearsed: tuple[Runtime, Rehearsal]) -> None:
    runtime, rehearsal = rehearsed
    (record,) = runtime.store.sessions()
    widths = {one.query_index: one.samples.shape[1] for one in runtime.store.posteriors(record.id)}
    assert widths == {index: 4 if index < 15 else 5 for index in range(21)}
    assert [row["posterior_mean"]["learned"] is None for row in rehearsal.rows] == [True] * 14 + [False] * 8
    assert set(rehearsal.rows[0]) == set(rehearsal.rows[-1])


def test_the_feature_is_the_one_that_the_first_answers_teach(rehearsed: tuple[Runtime, Rehearsal]) -> None:
    runtime, _ = rehearsed
    (record,) = runtime.store.sessions()
    state = runtime.live(record.id).state
    assert state.participant is not None
    expected = learn_feature(STUDY, state.participant, 11, compared(state, 11))
    assert state.knowledge.feature == expected


LONGER = online(("active_queries = 20 ", "active_queries = 18 "))


def test_queries_after_a_feature_are_chosen_with_it_and_replay_derives_it_again(tmp_path: Path) -> None:
    with wiring.headless() as runtime:
        rehearse(runtime, LONGER, BOTH_SIDES, 1, lambda: None)
        (record,) = runtime.store.sessions()
        prepared = runtime.live(record.id).state.prepared
        export(runtime.store, tmp_path / "out", ExportOptions("jsonl", "all"))
        export(runtime.store, tmp_path / "csv", ExportOptions("csv", "all"))
    weights = [one.proposed.provenance.weights_a for one in prepared[:18]]
    assert [len(one) for one in weights] == [4] * 15 + [5] * 3
    with wiring.headless() as runtime:
        (person,) = people_of(open_export(tmp_path / "out"))
        (learned,) = [event for event in person.log if isinstance(event, FeatureLearned)]
        assert learned.query_index == 15
        derive(runtime, person)
        assert learned.feature is not None
        moved = replace(learned.feature, drives=learned.feature.drives + 1e-9)
        other = replace(learned, feature=moved)
        changed = replace(person, log=tuple(other if event is learned else event for event in person.log))
        with pytest.raises(
            ReplayDifferenceError, match=r"before query 15 is not .* feature\.drives\[0\]\[0\]"
        ):
            derive(runtime, changed)
        without = replace(person, log=tuple(event for event in person.log if event is not learned))
        with pytest.raises(ReplayDifferenceError, match="expected a feature to be learned before query 15"):
            derive(runtime, without)


def test_somebody_who_skips_is_asked_on_without_a_feature() -> None:
    study = online(("[prior]", 'answers = ["a", "b", "skip"]\n\n[prior]'))
    with wiring.headless() as runtime:
        _, record = services.join(runtime, study, rehearsal="skips")
        walk(runtime, record.id, lambda asked: AnswerGiven(asked.query_index, Choice.SKIP, 900))
        kinds = {event.kind for event in runtime.store.events(record.id)}
        widths = {one.samples.shape[1] for one in runtime.store.posteriors(record.id)}
    assert "feature_learned" not in kinds
    assert widths == {4}


def test_learning_begins_as_soon_as_the_answers_are_there(rehearsed: tuple[Runtime, Rehearsal]) -> None:
    runtime, _ = rehearsed
    _, record = services.join(runtime, STUDY, rehearsal="early")
    live = runtime.live(record.id)
    for index in range(12):
        assert (live.learning is not None) == (index >= 11)
        services.answer(runtime, record.id, index, "ab"[index % 2], 900)
        services.screen(runtime, record.id)
    assert live.learning is not None
    assert live.learning[0].n_queries == 11
    assert feature_before(runtime, live, live.state, 15) is live.learning[1]


def test_a_session_read_again_goes_on_with_what_it_had_learned(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'again.db'}"
    with wiring.headless(url) as runtime:
        rehearse(runtime, STUDY, BOTH_SIDES, 1, lambda: None)
        (record,) = runtime.store.sessions()
        before = runtime.live(record.id).state.knowledge
    with wiring.headless(url) as runtime:
        assert runtime.live(record.id).state.knowledge == before
        stored = [from_json(event.kind, event.payload) for event in runtime.store.events(record.id)]
    assert sum(isinstance(event, FeatureLearned) for event in stored) == 1


def test_a_feature_that_cannot_be_learned_loses_no_answer_and_is_learned_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with wiring.headless(f"sqlite:///{tmp_path / 'fails.db'}") as runtime:
        learn, n_failures = runtime.learn_fn, 0

        def fail_at_first(request: FeatureRequest) -> FeatureLearned:
            nonlocal n_failures
            n_failures += 1
            if n_failures < 4:
                raise MemoryError
            return learn(request)

        monkeypatch.setattr(runtime, "learn_fn", fail_at_first)
        _, record = services.join(runtime, STUDY, rehearsal="unlucky")
        for index in range(22):
            while services.screen(runtime, record.id).kind == "preparing":
                time.sleep(0.05)
            receipt = services.answer(runtime, record.id, index, "ab"[index % 2], 900)
            assert receipt.outcome is Outcome.TAKEN
        assert services.screen(runtime, record.id).kind == "finished"
        learned = [event for event in runtime.events(record.id) if isinstance(event, FeatureLearned)]
    assert n_failures == 4
    assert [event.query_index for event in learned] == [15]


ALONG_A_PATH = """

[[path]]
step = "practice"
queries = 2

[[path]]
step = "queries"
break_every = 5
"""


def test_what_teaches_nothing_teaches_no_feature_either(tmp_path: Path) -> None:
    """Practice, repeats and checks move a feature to a later query, and are not what it is learned from."""
    study = online(("test_queries = 2 ", "repeats = 2\nchecks = 1\ntest_queries = 2 "))
    study = parse_study(
        study.text.replace("[text]\n", '[text]\npractice = "A few to begin with."\nbreak = "Rest."\n')
        + ALONG_A_PATH
    )
    with wiring.headless() as runtime:
        rehearse(runtime, study, BOTH_SIDES, 1, lambda: None)
        (record,) = runtime.store.sessions()
        state = runtime.live(record.id).state
        export(runtime.store, tmp_path / "out", ExportOptions("jsonl", "all"))
        prepared, answers = state.prepared, state.answers
    (person,) = people_of(open_export(tmp_path / "out"))
    (learned,) = [event for event in person.log if isinstance(event, FeatureLearned)]
    # Eleven active queries teach the feature that the fifteenth is the first to be chosen with.
    is_active = np.array([one.phase is Phase.ACTIVE for one in prepared])
    assert (is_active[: learned.n_queries].sum(), is_active[: learned.query_index].sum()) == (11, 15)
    assert is_active[learned.query_index]
    assert learned.query_index > 15
    taught = [
        (one.proposed.query, given.choice)
        for one, given in zip(prepared[: learned.n_queries], answers, strict=False)
        if one.phase is Phase.ACTIVE
    ]
    comparisons = ComparisonSet(
        np.array([query.feature_diff for query, _ in taught]), np.array([choice.sign for _, choice in taught])
    )
    controls = np.array([[query.controls_a, query.controls_b] for query, _ in taught])
    assert state.participant is not None
    expected = learn_feature(study, state.participant, learned.n_queries, Compared(comparisons, controls))
    assert learned.feature == expected
    with wiring.headless() as runtime:
        derive(runtime, person)
