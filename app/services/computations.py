"""What can be done with computations wherever they run: seeing whether they have succeeded, and chaining them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from typing import Any

from app.services.continuation import Computation

HandOver = Callable[..., None]
"""Runs a function with its arguments soon, in another thread; not at all when the process is ending."""


def hand_over(executor: Executor, function: Callable[..., object], *arguments: object) -> None:
    """Runs a function soon, in another thread; refused when the process is ending: the next one begins again."""
    with suppress(RuntimeError):
        executor.submit(function, *arguments)


def has_succeeded(computation: Computation) -> bool:
    """Returns whether a result is there; a failed computation is left to the delivery, which reports it."""
    if not computation.done():
        return False
    try:
        computation.result()
    except Exception:  # noqa: BLE001 - whatever it was, the answer must be taken first
        return False
    return True


def then(hand_over: HandOver, first: Computation, begin: Callable[[Any], Computation]) -> Computation:
    """Returns what `begin` computes from the result of `first`, and fails as either of them fails.

    Args:
        hand_over: Runs `begin`: whoever completes `first` has other things to do.
        first: On its way.
        begin: Takes the result of `first`; starts the second computation.
    """
    chained: Future[Any] = Future()
    first.add_done_callback(lambda _: hand_over(_begin_second, first, begin, chained))
    return chained


def _begin_second(first: Computation, begin: Callable[[Any], Computation], chained: Future[Any]) -> None:
    if not chained.set_running_or_notify_cancel():
        return
    try:
        second = begin(first.result())
    except Exception as error:  # noqa: BLE001 - handed on to whoever asks
        chained.set_exception(error)
        return
    second.add_done_callback(lambda done: _finish(done, chained))


def _finish(second: Computation, chained: Future[Any]) -> None:
    try:
        chained.set_result(second.result())
    except Exception as error:  # noqa: BLE001 - handed on to whoever asks
        chained.set_exception(error)
