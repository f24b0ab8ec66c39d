"""Turns are taken one at a time, in order, and nobody is forgotten."""

import threading
import time

import pytest

from app.store.turns import Turns


def wait_until_queued(turns, n):
    deadline = time.monotonic() + 10
    while len(turns._waiting) < n:
        assert time.monotonic() < deadline
        time.sleep(0.001)


def test_turns_come_in_the_order_of_asking():
    turns = Turns()
    order = []

    def take(number):
        with turns:
            order.append(number)

    threads = [threading.Thread(target=take, args=(number,)) for number in range(8)]
    with turns:
        for number, thread in enumerate(threads):
            thread.start()
            wait_until_queued(turns, number + 1)
    for thread in threads:
        thread.join(timeout=10)
    assert order == list(range(8))


def test_only_one_holds_it_at_a_time():
    turns = Turns()
    count = 0

    def add():
        nonlocal count
        for _ in range(200):
            with turns:
                seen = count
                time.sleep(0)
                count = seen + 1

    threads = [threading.Thread(target=add) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=30)
    assert count == 1200


def test_an_error_inside_hands_it_on():
    turns = Turns()
    with pytest.raises(ValueError, match="inside"), turns:
        raise ValueError("inside")
    with turns:
        pass


@pytest.mark.parametrize("was_its_turn", [False, True])
def test_one_who_stops_waiting_holds_nobody_up(was_its_turn):
    turns = Turns()
    turns.__enter__()
    leaver = threading.Lock()
    leaver.acquire()
    turns._waiting.append(leaver)
    if was_its_turn:
        turns.__exit__()
        turns._leave(leaver)
    else:
        turns._leave(leaver)
        turns.__exit__()
    with turns:
        pass
