"""What has to be computed for a session to go on: a pure function of the request, so anyone may compute it again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

from study_core.comparison import ComparisonSet
from study_core.events import FeatureLearned, QueryPrepared
from study_core.knowledge import NOTHING, Knowledge
from study_core.online.feature import Compared
from study_core.posterior.run import Posterior
from study_core.queries import Participant, ProposedQuery

VERSION = "continuation-4"


@dataclass(frozen=True)
class Request:
    """Everything a continuation depends on.

    Attributes:
        study_text: The study file's text.
        participant: Names the session's random streams.
        query_index: The query to prepare.
        comparisons: Answers that inform the posterior, in the hand-coded features; none without a posterior.
        needs_posterior: Whether the query is chosen from one, or is the first after the last that was.
        given_query: A query that need not be chosen: of the common test set, or one that is asked again.
        knowledge: What else informs the posterior.
        learned: A feature that the session goes on with from this query on.
        compared: The same answers with what they compared; None where no feature has been learned.
    """

    study_text: str
    participant: Participant
    query_index: int
    comparisons: ComparisonSet
    needs_posterior: bool
    given_query: ProposedQuery | None
    knowledge: Knowledge = NOTHING
    learned: FeatureLearned | None = None
    compared: Compared | None = None

    @cached_property
    def key(self) -> str:
        """Returns the name of the computation: equal requests are computed once, and none goes stale."""
        digest = hashlib.sha256(self.study_text.encode())
        digest.update(f"{VERSION}|{self.participant!r}|{self.query_index}|{self.needs_posterior}".encode())
        digest.update(f"{self.knowledge.digest}|{self.learned is not None}".encode())
        digest.update(self.comparisons.feature_diffs.tobytes())
        digest.update(self.comparisons.signs.tobytes())
        if self.given_query is not None:
            # One that is asked again depends on answers that nothing else here tells.
            digest.update(self.given_query.query.controls_a.tobytes())
            digest.update(self.given_query.query.controls_b.tobytes())
        return f"continuation-{digest.hexdigest()}"


@dataclass(frozen=True)
class Continuation:
    """The next query, ready to be shown.

    Attributes:
        prepared: The query.
        posterior: What it was chosen from, if an answer has come since the last one.
        learned: A feature that it was the first to be chosen with.
    """

    prepared: QueryPrepared
    posterior: Posterior | None
    learned: FeatureLearned | None = None


@dataclass(frozen=True)
class FeatureRequest:
    """Everything that a feature depends on which a session learns from its own answers.

    Attributes:
        study_text: The study file's text.
        participant: Names the session's random streams.
        query_index: The first query that is to be chosen with it.
        n_queries: It is learned from the answers to so many first queries.
        compared: Those answers, as far as they say something.
    """

    study_text: str
    participant: Participant
    query_index: int
    n_queries: int
    compared: Compared

    @cached_property
    def key(self) -> str:
        """Returns the name of the computation."""
        digest = hashlib.sha256(self.study_text.encode())
        digest.update(f"{VERSION}|{self.participant!r}|{self.query_index}|{self.n_queries}".encode())
        digest.update(self.compared.controls.tobytes())
        digest.update(self.compared.comparisons.signs.tobytes())
        return f"feature-{digest.hexdigest()}"


ContinueFn = Callable[[Request], Continuation]
LearnFn = Callable[[FeatureRequest], FeatureLearned]
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

    def troubles(self) -> list[str]:
        """Returns what is wrong with it, or was lately: one sentence each."""
        ...
