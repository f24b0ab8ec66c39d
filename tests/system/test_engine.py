"""The engine computes what it is given, once, in other processes, whatever dies."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from functools import partial

import pytest

from app.engine.dask_engine import DaskEngine
from app.engine.on_demand import InlineEngine

_PATIENCE_S = 120.0
_INTERVAL_S = 0.25


@pytest.fixture(scope="module")
def engine() -> Iterator[DaskEngine]:
    warm_up = partial(sys.setswitchinterval, _INTERVAL_S)
    started = DaskEngine(n_workers=1, warm_up=warm_up, n_training_workers=1)
    yield started
    started.close()


def test_what_is_submitted_together_comes_back_in_order(engine: DaskEngine) -> None:
    computations = engine.submit_together(abs, {"one": -1, "two": -2, "three": -3}, urgency=0.0)
    assert [each.result(_PATIENCE_S) for each in computations] == [1, 2, 3]


def test_no_message_is_kept_once_it_is_sent(engine: DaskEngine) -> None:
    assert engine.submit("secret", abs, -1, urgency=0.0).result(_PATIENCE_S) == 1
    stream = engine._client.scheduler_comm
    assert stream is not None
    assert stream.message_count > 0
    assert len(stream.recent_message_log) == 0


def test_inline_computes_only_what_is_asked_for() -> None:
    asked: list[object] = []
    computations = InlineEngine().submit_together(asked.append, {"one": 1, "two": 2}, urgency=0.0)
    computations[1].result()
    assert asked == [2]


def test_the_same_key_is_the_same_computation(engine: DaskEngine) -> None:
    first, second = engine.submit_together(time.sleep, {"nap": 0.5, "long nap": 0.6}, urgency=0.0)
    assert engine.submit("long nap", time.sleep, 0.6, urgency=0.0) is second
    assert first.result(_PATIENCE_S) is None


def test_what_becomes_urgent_overtakes_what_was_sent_before(engine: DaskEngine) -> None:
    begun = engine.submit("blocks the worker", time.sleep, 0.5, urgency=0.0)
    finished: list[str] = []
    waiting = engine.submit_together(str, {"slow": 1, "wanted": 2}, urgency=0.0)
    others = [engine.submit(f"other {n}", time.sleep, 0.05, urgency=1.0) for n in range(5)]
    for other in others:
        other.add_done_callback(lambda _: finished.append("other"))
    wanted = engine.submit("wanted", str, 2, urgency=10.0)
    wanted.add_done_callback(lambda _: finished.append("wanted"))
    assert wanted is waiting[1]
    assert [each.result(_PATIENCE_S) for each in (begun, wanted, *others, waiting[0])][1] == "2"
    assert finished[0] == "wanted"


def test_giving_one_up_leaves_the_other(engine: DaskEngine) -> None:
    engine.submit("blocks it again", time.sleep, 0.3, urgency=0.0)
    unwanted, wanted = engine.submit_together(abs, {"unwanted": -1, "kept": -2}, urgency=0.0)
    assert unwanted.cancel()
    assert wanted.result(_PATIENCE_S) == 2


def test_a_failure_is_handed_on(engine: DaskEngine) -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        engine.submit("not a number", int, "x", urgency=0.0).result(_PATIENCE_S)


def test_training_runs_on_a_worker_of_its_own_that_lets_everyone_else_go_first(engine: DaskEngine) -> None:
    where = "(__import__('os').getpid(), __import__('os').nice(0))"
    trained = engine.submit("trained", eval, where, urgency=-10.0, resource="training").result(_PATIENCE_S)
    asked = engine.submit("asked", eval, where, urgency=0.0).result(_PATIENCE_S)
    assert trained == (engine.process_ids["trainer"][0], 19)
    assert asked == (engine.process_ids["worker"][0], 10)


def test_nobody_waits_for_training(engine: DaskEngine) -> None:
    training = engine.submit("trains for long", time.sleep, 3.0, urgency=-10.0, resource="training")
    assert engine.submit("wanted meanwhile", abs, -5, urgency=0.0).result(_PATIENCE_S) == 5
    assert not training.done()
    assert training.result(_PATIENCE_S) is None


def test_a_killed_trainer_is_replaced_and_trains_again(engine: DaskEngine) -> None:
    training = engine.submit("trains again", time.sleep, 0.5, urgency=-10.0, resource="training")
    before = engine.process_ids["trainer"][0]
    os.kill(before, signal.SIGKILL)
    assert training.result(_PATIENCE_S) is None
    assert engine.process_ids["trainer"][0] != before


@pytest.mark.parametrize("victim", ["worker", "scheduler"])
def test_a_killed_process_is_replaced_and_its_work_done(engine: DaskEngine, victim: str) -> None:
    computations = engine.submit_together(
        time.sleep, {f"before {victim} 1": 0.3, f"before {victim} 2": 0.2}, urgency=0.0
    )
    os.kill(engine.process_ids[victim][0], signal.SIGKILL)
    after = engine.submit(f"after {victim}", abs, -4, urgency=0.0)
    assert [each.result(_PATIENCE_S) for each in computations] == [None, None]
    assert after.result(_PATIENCE_S) == 4


def test_every_worker_is_warmed_up_before_it_takes_work(engine: DaskEngine) -> None:
    asked = "__import__('sys').getswitchinterval()"
    assert engine.submit("in the worker", eval, asked, urgency=0.0).result(_PATIENCE_S) == _INTERVAL_S
    os.kill(engine.process_ids["worker"][0], signal.SIGKILL)
    assert engine.submit("in the next", eval, asked, urgency=0.0).result(_PATIENCE_S) == _INTERVAL_S
