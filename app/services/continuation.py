"""What has to be computed for a session to go on: a pure function of the request, so anyone may compute it again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

from study_core.comparison import ComparisonSet
from study_core.knowledge import NOTHING, Knowledge
from study_core.posterior.run import Posterior
from study_core.queries import Participant, ProposedQuery
from study_core.session import QueryPrepared

VERSION = "continuation-3"


@dataclass(frozen=True)
class Request:
    """Everything a continuation depends on.

    Attributes:
        study_text: The study file's text.
        participant: Names the session's random streams.
        query_index: The query to prepare.
        comparisons: Answers that inform the posterior, in the hand-coded features.
        needs_posterior: Whether an answer has come since the last posterior; always so in the active phase.
        test_query: The common test query to show, in the test phase.
        knowledge: What else informs the posterior.
    """

    study_text: str
    participant: Participant
    query_index: int
    comparisons: ComparisonSet
    needs_posterior: bool
    test_query: ProposedQuery | None
    knowledge: Knowledge = NOTHING

    @cached_property
    def key(self) -> str:
        """Returns the name of the computation: equal requests are computed once, and none goes stale."""
        digest = hashlib.sha256(self.study_text.encode())
        digest.update(f"{VERSION}|{self.participant!r}|{self.query_index}|{self.needs_posterior}".encode())
        digest.update(self.knowledge.digest.encode())
        digest.update(self.comparisons.feature_diffs.tobytes())
        digest.update(self.comparisons.signs.tobytes())
        return f"continuation-{digest.hexdigest()}"


@dataclass(frozen=True)
class Continuation:
    """The next query, ready to be shown, and the posterior it was chosen from."""

    prepared: QueryPrepared
    posterior: Posterior | None


ContinueFn = Callable[[Request], Continuation]
TestSetFn = Callable[[str], tuple[ProposedQuery, ...]]


class Computation(Protocol):
    """A result that is there or on its way."""

    def done(self) -> bool:
        """Returns whether `result` returns without waiting for another process."""
        ...

    def result(self, timeout: float | None = None) -> Any:
        """Returns the result, waiting for it if need be; raises what the computation raised."""
        ...

    def add_done_callback(self, fn: Callable[[Any], object], /) -> None:
        """Calls `fn` with the computation once it is done."""
        ...

    def cancel(self) -> bool:
        """Gives the computation up if nobody else waits for it."""
        ...


Resource = Literal["query", "training"]
"""Which workers compute something: those that people wait for, or those that learn when nobody waits."""


class Engine(Protocol):
    """Where computations run. Only pure functions of their arguments are submitted."""

    def submit(
        self,
        key: str,
        function: Callable[..., Any],
        argument: object,
        urgency: float,
        resource: Resource = "query",
    ) -> Computation:
        """Starts computing `function(argument)`.

        Args:
            key: Name of the result; the same key is computed once.
            function: Importable by name in another process.
            argument: Can be pickled.
            urgency: Larger runs earlier.
            resource: Which workers compute it.
        """
        ...

    def submit_together(
        self, function: Callable[..., Any], arguments: Mapping[str, object], urgency: float
    ) -> Sequence[Computation]:
        """Starts computing `function` of several arguments, of which probably only one will be asked for.

        Args:
            function: Importable by name in another process.
            arguments: By the name of their result; the first is computed first.
            urgency: Larger runs earlier.

        Returns:
            A computation for each argument, in their order. They may all be done at once, when the last is.
        """
        ...
