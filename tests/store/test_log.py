"""The log: append-only, durable, one writer per position, one answer per query."""

import subprocess
import sys
import threading
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.store import NewEvent, PositionTakenError, PosteriorRecord, Source, StoreError, open_store
from app.store.models import EventRow

ANSWER = NewEvent("answer_given", {"query_index": 0, "choice": "a"})
PREPARED = NewEvent("query_prepared", {"query_index": 0})


@pytest.fixture
def session_id(store):
    store.put_study("study", "Study", "text")
    return store.create_session("study", "token-hash", Source.REHEARSED).id


def test_a_new_session_has_an_empty_log(store, session_id):
    assert store.events(session_id) == ()


def test_events_come_back_in_order_with_their_payload_and_an_aware_time(store, session_id):
    before = datetime.now(UTC)
    store.append(session_id, 0, [PREPARED, ANSWER])
    store.append(session_id, 2, [NewEvent("study_finished")])

    added = store.events(session_id)
    assert [event.position for event in added] == [0, 1, 2]
    assert [event.kind for event in added] == ["query_prepared", "answer_given", "study_finished"]
    assert added[1].payload == {"query_index": 0, "choice": "a"}
    assert all(event.at.utcoffset() == timedelta(0) for event in added)
    assert before <= added[0].at <= datetime.now(UTC)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
@given(payload=st.dictionaries(st.text(), st.floats(allow_nan=False) | st.text() | st.integers(), max_size=4))
def test_any_payload_comes_back_from_the_database_equal(store, session_id, payload):
    position = len(store.events(session_id))
    store.append(session_id, position, [NewEvent("note_taken", payload)])
    assert store.events(session_id)[-1].payload == payload


@pytest.mark.parametrize("wrong_position", [-1, 0, 2])
def test_a_position_other_than_the_log_end_is_refused_and_writes_nothing(store, session_id, wrong_position):
    store.append(session_id, 0, [PREPARED])
    with pytest.raises(PositionTakenError, match="Read the log again"):
        store.append(session_id, wrong_position, [ANSWER])
    assert len(store.events(session_id)) == 1


@pytest.mark.parametrize("event", [ANSWER, PREPARED])
def test_a_query_is_prepared_and_answered_only_once(store, session_id, event):
    store.append(session_id, 0, [event])
    with pytest.raises(PositionTakenError, match="prepared once and answered once"):
        store.append(session_id, 1, [event])
    assert len(store.events(session_id)) == 1


def test_two_people_may_answer_the_same_query(store, session_id):
    other = store.create_session("study", "other-token-hash", Source.REHEARSED).id
    store.append(session_id, 0, [ANSWER])
    store.append(other, 0, [ANSWER])
    assert len(store.events(other)) == 1


@pytest.mark.parametrize("query_index", [None, "3", 3.0, True])
def test_an_answer_without_the_number_of_its_query_is_refused(store, session_id, query_index):
    with pytest.raises(StoreError, match="integer 'query_index'"):
        store.append(session_id, 0, [NewEvent("answer_given", {"query_index": query_index})])
    assert store.events(session_id) == ()


def test_events_are_appended_all_or_none(store, session_id):
    with pytest.raises(PositionTakenError):
        store.append(session_id, 0, [NewEvent("session_started"), ANSWER, ANSWER])
    assert store.events(session_id) == ()


@pytest.mark.parametrize("call", ["session", "events", "posteriors", "measures"])
def test_an_unknown_session_is_refused(store, call):
    with pytest.raises(StoreError, match="Expected the id of a session, got 'nobody'"):
        getattr(store, call)("nobody")


def test_appending_to_an_unknown_session_is_refused(store):
    with pytest.raises(StoreError, match="got 'nobody'"):
        store.append("nobody", 0, [ANSWER])


def test_of_two_threads_at_one_position_exactly_one_wins(store, session_id):
    n_rounds = 60
    start = threading.Barrier(2)
    outcomes = {"first": [], "second": []}

    def press(name):
        for position in range(n_rounds):
            start.wait(timeout=30)
            try:
                store.append(session_id, position, [NewEvent("button_pressed", {"by": name})])
                outcomes[name].append(True)
            except PositionTakenError:
                outcomes[name].append(False)

    threads = [threading.Thread(target=press, args=(name,)) for name in outcomes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)

    assert [first + second for first, second in zip(*outcomes.values(), strict=True)] == [1] * n_rounds
    for event in store.events(session_id):
        assert outcomes[event.payload["by"]][event.position]


OTHER_PROCESS = """
import sys
from app.store import NewEvent, PositionTakenError, open_store

url, session_id, n_events = sys.argv[1], sys.argv[2], int(sys.argv[3])
with open_store(url) as store:
    print("ready", flush=True)
    n_added = 0
    while n_added < n_events:
        try:
            store.append(session_id, len(store.events(session_id)), [NewEvent("there")])
            n_added += 1
        except PositionTakenError:
            pass
"""


def test_two_processes_write_one_log_without_losing_an_event(store, session_id, database_url):
    n_events = 40
    other = subprocess.Popen(
        [sys.executable, "-c", OTHER_PROCESS, database_url, session_id, str(n_events)],
        stdout=subprocess.PIPE,
        text=True,
    )
    with other:
        assert other.stdout.readline() == "ready\n"
        n_added = 0
        while n_added < n_events:
            try:
                store.append(session_id, len(store.events(session_id)), [NewEvent("here")])
                n_added += 1
            except PositionTakenError:
                pass
    assert other.returncode == 0
    events = store.events(session_id)
    assert [event.position for event in events] == list(range(2 * n_events))
    assert sum(event.kind == "there" for event in events) == n_events


def test_a_posterior_comes_back_bit_for_bit_with_its_events(store, session_id):
    samples = np.array([[0.1, -0.0, np.inf], [np.nan, 5e-324, 1 / 3]])
    summary = {"r_hat": [1.001, 1.0], "ess_bulk": 812.25, "acceptance": 0.31}
    posterior = PosteriorRecord(0, np.array([1 / 3, 0.2, 0.3]), samples, summary)
    store.append(session_id, 0, [PREPARED], posterior)

    (kept,) = store.posteriors(session_id)
    assert kept.query_index == 0
    assert kept.mean.tobytes() == posterior.mean.tobytes()
    assert kept.samples.shape == (2, 3)
    assert kept.samples.tobytes() == samples.tobytes()
    assert kept.summary == summary
    assert kept.parameters is None


def test_response_parameters_come_back_bit_for_bit_with_their_samples(store, session_id):
    parameters = np.array([[50.0, 1 / 3, 0.0], [5e-324, 0.1 + 0.2, 0.0]])
    store.append(session_id, 0, [PREPARED], PosteriorRecord(0, np.zeros(4), np.zeros((2, 4)), {}, parameters))
    (kept,) = store.posteriors(session_id)
    assert kept.parameters.tobytes() == parameters.tobytes()
    asked = NewEvent("query_prepared", {"query_index": 1})
    wrong = PosteriorRecord(1, np.zeros(4), np.zeros((2, 4)), {}, parameters.T)
    with pytest.raises(StoreError, match="response parameters of shape"):
        store.append(session_id, 1, [asked], wrong)


def test_a_posterior_is_not_kept_when_its_events_are_refused(store, session_id):
    with pytest.raises(PositionTakenError):
        store.append(session_id, 7, [PREPARED], PosteriorRecord(0, np.zeros(2), np.zeros((3, 2))))
    assert store.posteriors(session_id) == ()


@pytest.mark.parametrize(("mean", "samples"), [((2,), (3, 3)), ((2, 1), (3, 2)), ((2,), (6,))])
def test_a_posterior_of_the_wrong_shape_is_refused(store, session_id, mean, samples):
    with pytest.raises(StoreError, match=r"mean of shape \(d,\)"):
        store.append(session_id, 0, [PREPARED], PosteriorRecord(0, np.zeros(mean), np.zeros(samples)))
    assert store.events(session_id) == ()


def test_posteriors_are_ordered_by_query(store, session_id):
    for position, query_index in enumerate([2, 0, 1]):
        event = NewEvent("query_prepared", {"query_index": query_index})
        record = PosteriorRecord(query_index, np.zeros(1), np.zeros((1, 1)))
        store.append(session_id, position, [event], record)
    assert [posterior.query_index for posterior in store.posteriors(session_id)] == [0, 1, 2]


def test_the_log_is_there_after_reopening(store, session_id, database_url):
    store.append(session_id, 0, [PREPARED, ANSWER])
    added = store.events(session_id)
    store.close()
    with open_store(database_url) as reopened:
        assert reopened.events(session_id) == added


def test_a_naive_time_is_never_written():
    with pytest.raises(ValueError, match="naive"):
        EventRow.__table__.c.at.type.process_bind_param(datetime(2021, 1, 1), None)  # noqa: DTZ001
