"""Simulated people walk studies through the real services; what is known about them comes out as one tidy table."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from app import wiring
from app.services.rehearsal import Crowd, Rehearsal, rehearse_all
from app.settings import find_study
from study_core.participants import Habits
from study_core.study import Study, parse_study

QUICKSTART = find_study("quickstart")


def changed(*replacements: tuple[str, str]) -> Study:
    """The quickstart study with some lines changed."""
    text = QUICKSTART.text
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return parse_study(text)


SHORT = changed(("active_queries = 8 ", "active_queries = 3 "), ("test_queries = 4 ", "test_queries = 2 "))


def rehearsed(study: Study, crowd: Crowd, n_at_once: int = 1) -> list[Rehearsal]:
    with wiring.headless() as runtime:
        return list(rehearse_all(runtime, study, crowd, n_at_once, lambda: None))


def test_the_table_has_a_row_for_each_person_and_query_in_order() -> None:
    rehearsals = rehearsed(SHORT, Crowd(5, 3))
    rows = [row for rehearsal in rehearsals for row in rehearsal.rows]
    assert [(row["participant"], row["query_index"], row["phase"]) for row in rows] == [
        (f"rehearsal-5-{number}", index, "active" if index < 3 else "test")
        for number in (1, 2, 3)
        for index in range(5)
    ]
    assert len({tuple(row) for row in rows}) == 1
    for row in rows:
        assert row["probability"] == row["probability_of"][row["choice"]]
        assert sum(row["probability_of"].values()) == pytest.approx(1.0)


def test_a_row_says_how_well_the_truth_is_known_after_its_answer() -> None:
    (rehearsal,) = rehearsed(SHORT, Crowd(6, 1))
    for row in rehearsal.rows:
        mean = np.array(list(row["posterior_mean"].values()))
        truth = np.array(list(row["true_weight"].values()))
        cosine = mean @ truth / np.sqrt((mean @ mean) * (truth @ truth))
        assert row["alignment"] == pytest.approx(cosine, abs=1e-12)
    means = [tuple(row["posterior_mean"].values()) for row in rehearsal.rows]
    assert len(set(means[:3])) == 3
    assert means[2] == means[3] == means[4]
    assert rehearsal.summary["alignment"] == rehearsal.rows[-1]["alignment"]
    assert rehearsal.summary["posterior"]["mean"] == list(means[-1])


def test_the_last_answer_counts_where_nothing_is_asked_after_it() -> None:
    without_test = changed(
        ("active_queries = 8 ", "active_queries = 3 "), ("test_queries = 4 ", "test_queries = 0 ")
    )
    (with_it,), (without,) = rehearsed(SHORT, Crowd(7, 1)), rehearsed(without_test, Crowd(7, 1))
    assert without.rows == with_it.rows[:3]


def test_what_comes_out_does_not_depend_on_how_many_walk_at_the_same_time() -> None:
    crowd = Crowd(8, 5, Habits(drift_rad=0.1, side_bias=0.3))
    assert rehearsed(SHORT, crowd, n_at_once=1) == rehearsed(SHORT, crowd, n_at_once=4)


def test_people_answer_by_what_was_asked_for_them_and_not_by_the_study() -> None:
    (firm,) = rehearsed(SHORT, Crowd(9, 1))
    (odd,) = rehearsed(SHORT, Crowd(9, 1, Habits(drift_rad=0.2, side_bias=50.0), 20.0, 0.0))
    assert firm.rows[0]["true_weight"] == firm.rows[-1]["true_weight"] == odd.rows[0]["true_weight"]
    assert len({tuple(row["true_weight"].values()) for row in odd.rows}) == 5
    assert [row["choice"] for row in odd.rows] == [row["first_shown"] for row in odd.rows]
    assert {row["choice"] for row in odd.rows} == {"a", "b"}
    assert [row["probability"] for row in odd.rows] == pytest.approx([1.0] * 5)
    assert {(row["true_rationality"], row["true_lapse_rate"]) for row in odd.rows} == {(20.0, 0.0)}
    assert {(row["true_rationality"], row["true_lapse_rate"]) for row in firm.rows} == {(200.0, 0.1)}


def test_somebody_who_cannot_tell_teaches_nothing() -> None:
    study = changed(
        ("active_queries = 8 ", "active_queries = 3 "),
        ("test_queries = 4 ", "test_queries = 2 "),
        ("[response]", '[response]\nanswers = ["a", "b", "unsure"]'),
    )
    (rehearsal,) = rehearsed(study, Crowd(10, 1, Habits(unsure_rate=1.0)))
    assert [row["choice"] for row in rehearsal.rows] == ["unsure"] * 5
    means = np.array([list(row["posterior_mean"].values()) for row in rehearsal.rows])
    # The prior's, drawn anew for each query.
    assert np.ptp(means, axis=0).max() < 0.06
    assert rehearsal.summary["test_accuracy"] is None


def test_a_rehearsal_that_is_given_up_stops_soon() -> None:
    with wiring.headless() as runtime:
        n_answers = [0]

        def count() -> None:
            n_answers[0] += 1

        with closing(rehearse_all(runtime, SHORT, Crowd(11, 40), 2, count)) as rehearsals:
            next(rehearsals)
        assert n_answers[0] < 100
        assert len(runtime.store.sessions()) < 20
