"""Engines that compute only what is asked for, when it is: nothing is worth computing ahead of simulated people."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from app.services.continuation import Engine, Resource


class ComputationOnDemand:
    """A result that is computed when it is asked for."""

    def __init__(self, compute: Callable[[], Any]) -> None:
        self._compute = compute
        self._future: Future[Any] = Future()

    def done(self) -> bool:
        """Returns True: whoever asks for the result is the one to compute it."""
        return True

    def result(self, timeout: float | None = None) -> Any:
        """Returns the result, computed on the first call."""
        if not self._future.done():
            try:
                self._future.set_result(self._compute())
            except Exception as error:  # noqa: BLE001 - handed on to whoever asks
                self._future.set_exception(error)
        return self._future.result(timeout)

    def add_done_callback(self, fn: Callable[[Any], object], /) -> None:
        """Calls `fn` at once."""
        fn(self)

    def cancel(self) -> bool:
        """Returns True: what nobody asks for is never computed."""
        return True


class _EngineOnDemand:
    """What the engines of this module have in common; each says how it computes."""

    def submit(
        self,
        key: str,
        function: Callable[..., Any],
        argument: object,
        urgency: float,
        resource: Resource = "query",
    ) -> ComputationOnDemand:
        """Returns the computation; see `app.services.continuation.Engine`."""
        return ComputationOnDemand(lambda: self._compute(key, function, argument, urgency, resource))

    def submit_together(
        self, function: Callable[..., Any], arguments: Mapping[str, object], urgency: float
    ) -> list[ComputationOnDemand]:
        """Returns a computation for each argument; only those that are asked for are computed."""
        return [self.submit(key, function, argument, urgency) for key, argument in arguments.items()]

    def _compute(
        self, key: str, function: Callable[..., Any], argument: object, urgency: float, resource: Resource
    ) -> Any:
        raise NotImplementedError


class InlineEngine(_EngineOnDemand):
    """Computes in this process: headless replay and simulation."""

    def troubles(self) -> list[str]:
        """Returns nothing: if it were in trouble, so would be whoever asks."""
        return []

    def _compute(
        self, key: str, function: Callable[..., Any], argument: object, urgency: float, resource: Resource
    ) -> Any:
        return function(argument)


class OnDemandEngine(_EngineOnDemand):
    """Computes on another engine: many simulated people at once."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def _compute(
        self, key: str, function: Callable[..., Any], argument: object, urgency: float, resource: Resource
    ) -> Any:
        return self._engine.submit(key, function, argument, urgency, resource).result()

    def troubles(self) -> list[str]:
        """Returns the other engine's."""
        return self._engine.troubles()
