"""Simulated people walk studies through the real services; what is known about them comes out as one tidy table."""

from __future__ import annotations

from contextlib import closing
from itertools import permutations

import numpy as np
import pytest

from app import wiring
from app.services.rehearsal import Rehearsal, rehearse_all
from app.services.rehearsed_person import Crowd, Manners
from app.settings import find_study
from study_core.conditions import arm_of_rehearsal
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


FULL = find_study("full-path")
CONDITIONS = parse_study(
    SHORT.text
    + """
[[condition]]
name = "gain"
acquisition.method = "information-gain"

[[condition]]
name = "random"
acquisition.method = "random"

[[condition]]
name = "ties"
response.answers = ["a", "b", "same"]
response.tie_threshold = 1.0
"""
)


def test_of_each_three_people_in_a_row_one_walks_each_of_three_conditions() -> None:
    rehearsals = rehearsed(CONDITIONS, Crowd(12, 6), n_at_once=3)
    conditions = [rehearsal.summary["condition"] for rehearsal in rehearsals]
    assert sorted(conditions[:3]) == sorted(conditions[3:]) == ["gain", "random", "ties"]
    orders = {tuple(arm_of_rehearsal(12, 3 * block + place, 3) for place in (1, 2, 3)) for block in range(40)}
    assert orders == set(permutations(range(3)))
    for rehearsal, condition in zip(rehearsals, conditions, strict=True):
        # `prior` stands where no pair that the method tried looked different.
        methods = {row["method"] for row in rehearsal.rows if row["phase"] == "active"} - {"prior"}
        expected = {"gain": "information-gain", "random": "random", "ties": "information-gain-realistic"}
        assert methods == {expected[condition]}
        assert {row["condition"] for row in rehearsal.rows} == {condition}
        assert {row["probability_of"]["same"] is None for row in rehearsal.rows} == {condition != "ties"}
    tests_asked = [
        [row["feature_difference"] for row in rehearsal.rows if row["phase"] == "test"]
        for rehearsal in rehearsals
    ]
    assert all(asked == tests_asked[0] for asked in tests_asked)


def test_some_decline_some_leave_and_some_do_not_read() -> None:
    with wiring.headless() as runtime:
        for manners, endings in (
            (Manners(declining=1.0), {"declined"}),
            (Manners(leaving=1.0), {"stopped"}),
            (Manners(careless=1.0), {"failed", "completed"}),
            (Manners(), {"completed"}),
        ):
            crowd = Crowd(13, 4, manners=manners)
            found = list(rehearse_all(runtime, FULL, crowd, 1, lambda: None))
            assert {rehearsal.summary["ending"] for rehearsal in found} <= endings
            if manners.declining:
                assert all(rehearsal.rows == [] for rehearsal in found)
            if manners.leaving:
                assert len({len(rehearsal.rows) for rehearsal in found}) > 1


def test_whoever_completes_against_the_study_files_criteria_is_excluded() -> None:
    study = parse_study(
        SHORT.text.replace("[response]", "[exclusion]\nleast_median_response_ms = 1500\n\n[response]")
    )
    with wiring.headless() as runtime:
        list(rehearse_all(runtime, study, Crowd(14, 3), 1, lambda: None))
        list(rehearse_all(runtime, study, Crowd(15, 3, manners=Manners(careless=1.0)), 1, lambda: None))
        lines = runtime.store.person_lines(study.name)
    assert [line.review.verdict for line in lines] == [None] * 3 + ["excluded"] * 3
    assert {line.review.changed_by for line in lines[3:]} == {"study file"}
    assert all("expected at least 1500" in line.review.reason for line in lines[3:])
    assert [line.n_answers for line in lines] == [5] * 6
