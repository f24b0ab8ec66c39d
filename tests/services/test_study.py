"""What a participant can cause, through the real services, headless."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from app import wiring
from app.services import study as services
from app.services.runtime import Runtime
from app.services.study import InvalidAnswerError, Outcome
from app.services.tokens import hash_token
from app.settings import find_study
from study_core.comparison import Choice
from study_core.plan import Phase
from study_core.study import Study, parse_study

QUICKSTART = find_study("quickstart")


@pytest.fixture
def runtime(database_url: str) -> Iterator[Runtime]:
    with wiring.headless(database_url) as opened:
        yield opened


def answered(runtime: Runtime, session_id: str, choices: str) -> services.Screen:
    """Gives the answers in order to whatever is asked."""
    screen = services.screen(runtime, session_id)
    for choice in choices:
        assert screen.query_index is not None
        screen = services.answer(runtime, session_id, screen.query_index, choice, 1000).screen
    return screen


def with_skip() -> Study:
    """The quickstart study, offering two answers more."""
    text = QUICKSTART.text.replace("[response]", '[response]\nanswers = ["a", "b", "unsure", "skip"]')
    return parse_study(text)


def test_a_session_asks_eight_active_then_four_test_queries_and_ends(runtime: Runtime) -> None:
    _, record = services.join(runtime, QUICKSTART)
    screen = answered(runtime, record.id, "abbaabababba")
    assert screen.kind == "finished"
    prepared = runtime.live(record.id).state.prepared
    assert [p.phase for p in prepared] == [Phase.ACTIVE] * 8 + [Phase.TEST] * 4
    assert [p.query_index for p in prepared] == list(range(12))


def test_every_active_answer_updates_the_posterior_and_test_answers_do_not(runtime: Runtime) -> None:
    _, record = services.join(runtime, QUICKSTART)
    answered(runtime, record.id, "abbaabababba")
    posteriors = runtime.store.posteriors(record.id)
    # One before each active query, and one after the last active answer.
    assert [p.query_index for p in posteriors] == list(range(9))
    means = {tuple(p.mean) for p in posteriors}
    assert len(means) == 9
    assert all(p.samples.shape == (300, 4) for p in posteriors)
    assert all(set(p.summary) >= {"r_hat", "ess_bulk", "ess_tail", "acceptance"} for p in posteriors)


def test_the_answer_decides_the_next_query(runtime: Runtime) -> None:
    sessions = [services.join(runtime, QUICKSTART, rehearsal="the same streams")[1] for _ in range(2)]
    answered(runtime, sessions[0].id, "a")
    answered(runtime, sessions[1].id, "b")
    first, second = (runtime.live(session.id).state.prepared for session in sessions)
    assert first[0].proposed.query.controls_a.tolist() == second[0].proposed.query.controls_a.tolist()
    assert first[1].proposed.query.controls_a.tolist() != second[1].proposed.query.controls_a.tolist()


def test_two_people_get_queries_of_their_own_and_the_same_test_set(runtime: Runtime) -> None:
    people = [services.join(runtime, QUICKSTART)[1] for _ in range(2)]
    for person in people:
        answered(runtime, person.id, "a" * 12)
    one, two = (runtime.live(person.id).state.prepared for person in people)
    # A drive of the bank may come to both of them, a pair hardly.
    active = [(p.proposed.query.controls_a, p.proposed.query.controls_b) for p in (*one[:8], *two[:8])]
    assert len({tuple(np.concatenate(pair)) for pair in active}) == 16
    for mine, theirs in zip(one[8:], two[8:], strict=True):
        assert mine.proposed.query.controls_a.tolist() == theirs.proposed.query.controls_a.tolist()


def test_a_second_answer_to_the_same_query_is_already_taken_and_changes_nothing(runtime: Runtime) -> None:
    _, record = services.join(runtime, QUICKSTART)
    assert services.answer(runtime, record.id, 0, "a", 900).outcome is Outcome.TAKEN
    again = services.answer(runtime, record.id, 0, "b", 950)
    assert again.outcome is Outcome.ALREADY_TAKEN
    assert again.screen.query_index == 1
    stored = [e for e in runtime.store.events(record.id) if e.kind == "answer_given"]
    assert [e.payload["choice"] for e in stored] == ["a"]


@pytest.mark.parametrize("query_index", [1, 11, 99, -1])
def test_an_answer_to_a_query_that_is_not_asked_is_not_current(runtime: Runtime, query_index: int) -> None:
    _, record = services.join(runtime, QUICKSTART)
    receipt = services.answer(runtime, record.id, query_index, "a", 900)
    assert receipt.outcome is Outcome.NOT_CURRENT
    assert receipt.screen.query_index == 0


@pytest.mark.parametrize(
    ("choice", "time_ms", "said"),
    [("c", 10, "'a' or 'b'"), ("", 10, "'a' or 'b'"), ("A", 10, "'a' or 'b'"), ("a", -1, "response time")],
)
def test_an_impossible_answer_is_refused_with_the_reason(
    runtime: Runtime, choice: str, time_ms: int, said: str
) -> None:
    _, record = services.join(runtime, QUICKSTART)
    with pytest.raises(InvalidAnswerError, match=said):
        services.answer(runtime, record.id, 0, choice, time_ms)


def test_an_answer_that_the_study_does_not_offer_is_refused(runtime: Runtime) -> None:
    _, record = services.join(runtime, QUICKSTART)
    for choice in ("same", "unsure", "skip"):
        with pytest.raises(InvalidAnswerError, match=f"Expected the choice 'a' or 'b', got '{choice}'"):
            services.answer(runtime, record.id, 0, choice, 900)
    assert runtime.live(record.id).state.answers == ()


def test_an_answer_that_says_nothing_counts_as_answered_and_leaves_what_is_known_alone(
    runtime: Runtime,
) -> None:
    study = with_skip()
    _, record = services.join(runtime, study)
    for index, choice in enumerate(("unsure", "a", "skip")):
        receipt = services.answer(runtime, record.id, index, choice, 900)
        assert (receipt.outcome, receipt.screen.query_index) == (Outcome.TAKEN, index + 1)
    live = runtime.live(record.id)
    assert [given.choice for given in live.state.answers] == [Choice.UNSURE, Choice.A, Choice.SKIP]
    assert live.state.comparisons.signs.tolist() == [1.0]
    first, second, third, fourth = (one.mean for one in runtime.store.posteriors(record.id))
    # Drawn anew, so that a method that compares samples doesn't ask the same again; alike within Monte Carlo error.
    np.testing.assert_allclose(first, second, rtol=0, atol=0.04)
    np.testing.assert_allclose(third, fourth, rtol=0, atol=0.04)
    assert not np.array_equal(first, second)
    assert np.abs(second - third).max() > 0.08


def test_answers_that_say_nothing_share_one_computation_ahead(runtime: Runtime) -> None:
    study = with_skip()
    _, record = services.join(runtime, study)
    services.screen(runtime, record.id)
    ahead = runtime.live(record.id).ahead
    assert set(ahead) == set(study.answers)
    assert ahead[Choice.UNSURE] is ahead[Choice.SKIP]
    assert len({id(begun) for begun in ahead.values()}) == 3


def test_many_presses_at_once_make_one_answer(runtime: Runtime) -> None:
    _, record = services.join(runtime, QUICKSTART)
    with ThreadPoolExecutor(8) as pool:
        receipts = list(pool.map(lambda n: services.answer(runtime, record.id, 0, "ab"[n % 2], n), range(16)))
    assert sum(receipt.outcome is Outcome.TAKEN for receipt in receipts) == 1
    assert sum(e.kind == "answer_given" for e in runtime.store.events(record.id)) == 1


def test_a_restarted_process_goes_on_at_the_same_query(database_url: str) -> None:
    with wiring.headless(database_url) as before:
        token, record = services.join(before, QUICKSTART)
        answered(before, record.id, "abba")
        shown = before.live(record.id).state.prepared[-1]
    with wiring.headless(database_url) as after:
        found = services.find(after, token)
        assert found == record
        screen = services.screen(after, record.id)
        assert (screen.kind, screen.query_index) == ("question", 4)
        again = after.live(record.id).state.prepared[-1]
        assert again.proposed.query.controls_a.tolist() == shown.proposed.query.controls_a.tolist()


def test_a_process_that_wrote_behind_our_back_is_noticed(database_url: str) -> None:
    with wiring.headless(database_url) as one, wiring.headless(database_url) as two:
        _, record = services.join(one, QUICKSTART)
        assert services.screen(two, record.id).query_index == 0
        services.answer(one, record.id, 0, "a", 900)
        late = services.answer(two, record.id, 0, "b", 950)
        assert late.outcome is Outcome.ALREADY_TAKEN
        assert late.screen.query_index == 1


def test_a_restart_between_an_answer_and_the_next_query_prepares_it(database_url: str) -> None:
    with wiring.headless(database_url) as runtime:
        _, record = services.join(runtime, QUICKSTART)
        # As if the process had died before the query was computed: the answer alone is in the log.
        runtime.store.append(
            record.id, 2, [services_event("answer_given", query_index=0, choice="a", response_time_ms=5)]
        )
    with wiring.headless(database_url) as after:
        screen = services.screen(after, record.id)
        assert (screen.kind, screen.query_index) == ("question", 1)


def test_the_token_is_stored_only_as_a_hash(runtime: Runtime) -> None:
    token, record = services.join(runtime, QUICKSTART)
    assert len(token) >= 22
    assert token not in repr(record)
    assert runtime.store.session_by_token(token) is None
    assert runtime.store.session_by_token(hash_token(token)) == record
    assert services.find(runtime, token + "x") is None


def services_event(kind: str, **payload: object) -> object:
    from app.store import NewEvent

    return NewEvent(kind, payload)
