"""Where everybody stands, in one query; and who counts for a condition's balance."""

import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from app.store import Arm, ExternalPerson, NewEvent, Review, Source, Standing, Verdict


def standing(**changes):
    nothing = dict.fromkeys(
        (
            "step",
            "n_answers",
            "n_repeats",
            "n_repeats_agreed",
            "n_checks",
            "n_checks_passed",
            "n_sided",
            "n_first",
        ),
        0,
    )
    return Standing(**{**nothing, "response_ms": 0, "test_answers": "", **changes})


@pytest.fixture
def session_id(store):
    store.put_study("v1", "mine", "text")
    person = ExternalPerson("mine", "P1", {"STUDY_ID": "s"})
    return store.create_session("v1", "token", Source.JOINED, person=person).id


def test_a_line_says_who_somebody_is_and_where_they_stand(store, session_id):
    (line,) = store.person_lines("mine")
    assert (line.session.id, line.external.external_id, line.n_events, line.mean) == (
        session_id,
        "P1",
        0,
        None,
    )
    mean = np.array([0.1, 0.2, 0.3])
    now = standing(step=2, n_answers=7, test_answers="ab-", r_hat=1.01, ess=300.0, mean=mean)
    store.append(session_id, 0, [NewEvent("something")], standing=now)
    line = store.person_line(session_id)
    assert (line.step, line.n_answers, line.test_answers, line.n_events) == (2, 7, "ab-", 1)
    assert (line.r_hat, line.ess) == (1.01, 300.0)
    np.testing.assert_array_equal(line.mean, mean)
    assert line.last_at <= datetime.now(UTC)
    assert store.standing_lengths() == {session_id: 1}


def test_what_comes_without_a_posterior_keeps_the_last_one(store, session_id):
    store.append(session_id, 0, [NewEvent("one")], standing=standing(mean=np.ones(2), r_hat=1.0, ess=9.0))
    store.append(session_id, 1, [NewEvent("two")], standing=standing(n_answers=1))
    line = store.person_line(session_id)
    np.testing.assert_array_equal(line.mean, np.ones(2))
    assert (line.r_hat, line.ess, line.n_answers) == (1.0, 9.0, 1)


def test_waits_and_looks_away_add_up(store, session_id):
    store.append(session_id, 0, [NewEvent("answer")], standing=standing(focus_losses=2))
    time.sleep(0.05)
    store.append(session_id, 1, [NewEvent("question")], standing=standing(is_wait=True))
    store.append(session_id, 2, [NewEvent("answer")], standing=standing(focus_losses=1))
    line = store.person_line(session_id)
    assert (line.n_waits, line.focus_losses) == (1, 3)
    assert line.waited_ms >= 50


def test_a_session_that_the_study_file_excludes_is_so_in_the_same_transaction(store, session_id):
    store.append(
        session_id, 0, [NewEvent("end")], ending="completed", standing=standing(), excluded_because="asleep"
    )
    review = store.person_line(session_id).review
    assert (review.verdict, review.reason, review.changed_by) == (Verdict.EXCLUDED, "asleep", "study file")


def test_what_an_experimenter_has_decided_stays(store, session_id):
    store.desk.put_review(session_id, Review(Verdict.REJECTED, "mine"), "ann")
    store.append(session_id, 0, [NewEvent("end")], ending="completed", excluded_because="asleep")
    assert store.person_line(session_id).review.reason == "mine"


def test_arms_count_whoever_completed_and_counts_and_whoever_may_still(store):
    for condition in ("x", "y"):
        store.put_study(f"v1-{condition}", "mine", f"{condition}", "v1", condition)
    made = {}
    for n, (condition, ending) in enumerate(
        [("x", "completed"), ("x", "completed"), ("x", None), ("x", "stopped"), ("y", None), ("y", None)]
    ):
        session = store.create_session(f"v1-{condition}", f"token-{n}", Source.JOINED)
        store.append(session.id, 0, [NewEvent("begun")], ending=ending, standing=standing())
        made[n] = session.id
    store.create_session("v1-y", "rehearsed", Source.REHEARSED)
    store.desk.put_review(made[0], Review(Verdict.EXCLUDED, "slept"), "ann")
    ago = datetime.now(UTC) - timedelta(hours=1)
    assert sorted(store.arms("mine", ago), key=str) == [Arm("x", 1, 1), Arm("y", 0, 2)]
    later = datetime.now(UTC) + timedelta(hours=1)
    assert sorted(store.arms("mine", later), key=str) == [Arm("x", 1, 0), Arm("y", 0, 0)]


def test_people_are_numbered_through_all_arms_and_versions(store):
    store.put_study("v1-x", "mine", "a", "v1", "x")
    store.put_study("v1-y", "mine", "b", "v1", "y")
    store.put_study("v2", "mine", "c")
    store.put_study("other", "other", "d")
    ordinals = [
        store.create_session(name, f"t-{n}", Source.JOINED).ordinal
        for n, name in enumerate(["v1-x", "v1-y", "v2", "other"])
    ]
    assert ordinals == [1, 2, 3, 1]


def test_ids_of_people_who_ended_long_ago_are_forgotten_to_the_last_byte(store, database_url):
    store.put_study("v1", "mine", "text")
    for n, ending in enumerate(["completed", None]):
        person = ExternalPerson("mine", f"SECRET-{n}", {"SESSION_ID": f"ALSO-{n}"})
        session = store.create_session("v1", f"token-{n}", Source.JOINED, person=person)
        store.append(session.id, 0, [NewEvent("begun")], ending=ending)
    assert store.forget_external_people("mine", datetime.now(UTC) - timedelta(days=1)) == 0
    assert store.forget_external_people("mine", datetime.now(UTC) + timedelta(days=1)) == 1
    assert [line.external and line.external.external_id for line in store.person_lines("mine")] == [
        None,
        "SECRET-1",
    ]
    content = Path(database_url.removeprefix("sqlite:///")).read_bytes()
    assert b"SECRET-0" not in content
    assert b"ALSO-0" not in content
