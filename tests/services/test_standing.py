"""Where a session stands follows from its log alone, and is kept up with it."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from app import wiring
from app.services.rehearsal import rehearse
from app.services.rehearsed_person import Crowd, Manners
from app.services.runtime import Runtime
from app.services.standing import catch_up
from app.services.summary import summarise
from app.settings import find_study
from app.store import PersonLine
from study_core.participants import Habits
from study_core.study import Study

FULL = find_study("full-path")


@pytest.fixture
def runtime(database_url: str) -> Iterator[Runtime]:
    with wiring.headless(database_url) as opened:
        yield opened


def walked(runtime: Runtime, crowd: Crowd, number: int = 1, study: Study = FULL) -> PersonLine:
    rehearse(runtime, study, crowd, number, lambda: None)
    return runtime.store.person_lines(study.name)[-1]


def test_a_standing_counts_what_the_log_says(runtime: Runtime) -> None:
    line = walked(runtime, Crowd(31, 1, Habits(side_bias=2.0)))
    log = [(event.kind, event.payload) for event in runtime.store.events(line.session.id)]
    prepared = {payload["query_index"]: payload for kind, payload in log if kind == "query_prepared"}
    answers = {payload["query_index"]: payload for kind, payload in log if kind == "answer_given"}
    first = sum(
        answers[i]["choice"] == prepared[i]["first_shown"] for i in answers if answers[i]["choice"] in "ab"
    )
    assert line.n_answers == len(answers) == 14
    assert line.n_sided == sum(answer["choice"] in ("a", "b") for answer in answers.values())
    assert line.n_first == first
    assert line.response_ms == sum(answer["response_time_ms"] for answer in answers.values())
    tests = [i for i in sorted(prepared) if prepared[i]["phase"] == "test"]
    letters = [answers[i]["choice"] if answers[i]["choice"] in ("a", "b") else "-" for i in tests]
    assert line.test_answers == "".join(letters)
    repeats = [i for i in prepared if prepared[i]["repeat_of"] is not None]
    agreed = sum(answers[i]["choice"] == answers[prepared[i]["repeat_of"]]["choice"] for i in repeats)
    assert (line.n_repeats, line.n_repeats_agreed) == (2, agreed)
    assert (line.n_checks, line.n_checks_passed) == (1, 1)
    assert line.n_events == len(log)
    assert line.step == len(FULL.file.path)


def test_the_last_posterior_and_its_worst_diagnostics_are_at_hand(runtime: Runtime) -> None:
    line = walked(runtime, Crowd(32, 1))
    last = runtime.store.posteriors(line.session.id)[-1]
    np.testing.assert_array_equal(line.mean, last.mean)
    assert line.r_hat == max(last.summary["r_hat"])
    assert line.ess == min(last.summary["ess_bulk"])


def test_the_accuracy_so_far_follows_from_mean_answers_and_test_set(runtime: Runtime) -> None:
    line = walked(runtime, Crowd(33, 1))
    summary = summarise(runtime, line.session.id)
    test_set = runtime.open_study(FULL).test_set
    differences = np.array([one.query.feature_diff for one in test_set])
    predicted = ["a" if value > 0 else "b" for value in differences @ line.mean]
    sided = [(p, g) for p, g in zip(predicted, line.test_answers, strict=True) if g != "-"]
    assert summary["test_accuracy"] == pytest.approx(np.mean([p == g for p, g in sided]))


def test_whoever_leaves_stands_where_they_left(runtime: Runtime) -> None:
    line = walked(runtime, Crowd(34, 1, manners=Manners(declining=1.0)))
    assert (line.ending, line.step, line.n_answers, line.mean) == ("declined", 0, 0, None)


def test_standings_that_are_missing_are_made_from_the_logs(runtime: Runtime, database_url: str) -> None:
    walked(runtime, Crowd(35, 2), 1)
    walked(runtime, Crowd(35, 2, manners=Manners(leaving=1.0)), 2)
    known = runtime.store.person_lines(FULL.name)
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as rows, rows:
        rows.execute("DELETE FROM standings")
    assert all(line.n_events == 0 for line in runtime.store.person_lines(FULL.name))
    assert catch_up(runtime.store) == 2
    assert catch_up(runtime.store) == 0
    for before, after in zip(known, runtime.store.person_lines(FULL.name), strict=True):
        for name in ("n_events", "step", "n_answers", "test_answers", "n_first", "n_sided", "r_hat", "ess"):
            assert getattr(after, name) == getattr(before, name), name
