"""Keeping the next query ready: it is computed for every possible answer while the person watches."""

from __future__ import annotations

import logging
from contextlib import suppress

import numpy as np

from app.services.continuation import Computation, Continuation, Request
from app.services.runtime import LiveSession, Runtime
from app.store import PopulationWithdrawnError, PositionTakenError, PosteriorRecord, SessionDeletedError
from study_core.choice import PARAMETER_PRIORS, ResponseParameters
from study_core.comparison import Choice, ComparisonSet
from study_core.posterior.run import Posterior
from study_core.session import Action, Event, Phase, QueryPrepared, next_action, phase_of

log = logging.getLogger(__name__)

# A person who waits comes before anything that is computed ahead.
_WAITED_FOR = 10.0
_AHEAD = 0.0

_LEVELS = (0.05, 0.5, 0.95)


def look_ahead(runtime: Runtime, live: LiveSession) -> None:
    """Starts computing what follows the current query, for each answer that makes a difference."""
    current = live.state.current
    live.ahead = {}
    following = live.state.query_index + 1
    if current is None or following >= live.study.protocol.n_queries:
        return
    query = current.proposed.query
    if current.phase is Phase.TEST:
        request = _request(live, following, live.state.comparisons, needs_posterior=False)
        live.ahead[None] = _submit(runtime, request, _AHEAD)
        return
    requests = {
        choice: _request(live, following, live.state.comparisons.append(query, choice), needs_posterior=True)
        for choice in live.study.answers
    }
    # Answers that say nothing all lead to the same query, which has one key.
    by_key = {request.key: request for request in requests.values()}
    begun = dict(
        zip(by_key, runtime.engine.submit_together(runtime.continue_fn, by_key, _AHEAD), strict=True)
    )
    live.ahead = {choice: begun[request.key] for choice, request in requests.items()}


def continuation_after(
    runtime: Runtime, live: LiveSession, choice: Choice, comparisons: ComparisonSet
) -> Computation:
    """Returns the continuation after an answer to the current query, begun now if it wasn't before.

    The one for the other answer is given up.
    """
    chosen = live.ahead.get(choice) or live.ahead.get(None)
    for other in live.ahead.values():
        if other is not chosen:
            other.cancel()
    live.ahead = {}
    if chosen is not None and chosen.done():
        return chosen
    # Submitted again, what was begun ahead goes before everything that nobody waits for yet.
    following = live.state.query_index + 1
    is_informed = phase_of(live.study, live.state.query_index) is Phase.ACTIVE
    return _submit(runtime, _request(live, following, comparisons, is_informed), _WAITED_FOR)


def prepare(runtime: Runtime, live: LiveSession) -> None:
    """Makes sure that a session that needs a query gets one; the caller holds its lock."""
    if next_action(live.study, live.state) is not Action.PREPARE or None in live.ahead:
        return
    index = live.state.query_index
    is_informed = index == 0 or phase_of(live.study, index - 1) is Phase.ACTIVE
    computation = _submit(runtime, _request(live, index, live.state.comparisons, is_informed), _WAITED_FOR)
    if not has_succeeded(computation):
        deliver_when_done(runtime, live, computation)
        return
    continuation: Continuation = computation.result()
    try:
        runtime.append(live, *entry(continuation))
    except PopulationWithdrawnError:
        # The state that was read again starts from the study file's prior.
        prepare(runtime, live)
        return
    announce(runtime, live, continuation)


def deliver_when_done(runtime: Runtime, live: LiveSession, computation: Computation) -> None:
    """Appends a continuation to the log as soon as it is computed, and shows it."""
    live.ahead = {None: computation}

    def hand_over(_: Computation) -> None:
        # Refused when the process is ending; the next one starts the computation again.
        with suppress(RuntimeError):
            runtime.background.submit(_deliver, runtime, live, computation)

    computation.add_done_callback(hand_over)


def _deliver(runtime: Runtime, live: LiveSession, computation: Computation) -> None:
    try:
        continuation: Continuation = computation.result()
    except Exception:
        # The log is whole: the next request for this session's screen starts the computation again.
        log.exception("session %s: the next query could not be computed", live.record.id)
        with live.lock:
            live.ahead = {}
        return
    with live.lock:
        # What is delivered now must not be taken for what follows it by an answer that comes at once.
        if live.ahead.get(None) is computation:
            live.ahead = {}
        if next_action(live.study, live.state) is not Action.PREPARE:
            return
        if continuation.prepared.query_index != live.state.query_index:
            return
        try:
            runtime.append(live, *entry(continuation))
        except PopulationWithdrawnError:
            log.info(
                "session %s: somebody before was deleted; its query is chosen without them", live.record.id
            )
            prepare(runtime, live)
            return
        except PositionTakenError:
            log.info("session %s: another process prepared the query first", live.record.id)
            return
        except SessionDeletedError:
            log.info("session %s was deleted before its query was ready", live.record.id)
            return
    announce(runtime, live, continuation)


def has_succeeded(computation: Computation) -> bool:
    """Returns whether a result is there; a failed computation is left to the delivery, which reports it."""
    if not computation.done():
        return False
    try:
        computation.result()
    except Exception:  # noqa: BLE001 - whatever it was, the answer must be taken first
        return False
    return True


def entry(continuation: Continuation) -> tuple[list[Event], PosteriorRecord | None]:
    """Returns what a continuation adds to the log, and the posterior that is stored with it."""
    prepared, posterior = continuation.prepared, continuation.posterior
    return [prepared], None if posterior is None else posterior_record(prepared.query_index, posterior)


def posterior_record(query_index: int, posterior: Posterior) -> PosteriorRecord:
    """Returns a posterior as it is stored."""
    diagnostics = posterior.diagnostics
    summary = {
        "r_hat": _finite(diagnostics.r_hat),
        "ess_bulk": _finite(diagnostics.ess_bulk),
        "ess_tail": _finite(diagnostics.ess_tail),
        "acceptance": diagnostics.acceptance,
        "n_draws": diagnostics.n_draws,
        "has_converged": diagnostics.has_converged,
        "warning": diagnostics.warning,
        **_spread(posterior.parameters),
    }
    return PosteriorRecord(query_index, posterior.mean, posterior.samples, summary)


def _spread(parameters: ResponseParameters) -> dict[str, dict[str, float]]:
    """Returns median and 90 % range of each response parameter; a fixed one has no range."""
    quantiles = {name: np.quantile(getattr(parameters, name), _LEVELS) for name in PARAMETER_PRIORS}
    return {
        name: dict(zip(("q05", "median", "q95"), values.tolist(), strict=True))
        for name, values in quantiles.items()
    }


def announce(runtime: Runtime, live: LiveSession, continuation: Continuation) -> None:
    """Shows a query that has just become the current one; looks ahead from it when the person has their reply."""
    runtime.on_change(live.record.id)
    runtime.background.submit(_look_ahead_from, runtime, live, continuation.prepared)


def _look_ahead_from(runtime: Runtime, live: LiveSession, prepared: QueryPrepared) -> None:
    with live.lock:
        if live.state.current is prepared and not live.ahead:
            look_ahead(runtime, live)


def _request(
    live: LiveSession, query_index: int, comparisons: ComparisonSet, needs_posterior: bool
) -> Request:
    n_active = live.study.protocol.active_queries
    test_query = live.opened.test_set[query_index - n_active] if query_index >= n_active else None
    assert live.state.participant is not None, "a session that has not begun needs no query"
    return Request(
        live.study.text,
        live.state.participant,
        query_index,
        comparisons,
        needs_posterior,
        test_query,
        live.state.knowledge,
    )


def _submit(runtime: Runtime, request: Request, urgency: float) -> Computation:
    return runtime.engine.submit(request.key, runtime.continue_fn, request, urgency)


def _finite(values: np.ndarray) -> list[float | None]:
    """Returns numbers as JSON knows them; what isn't finite (a quantity that never moved) is null."""
    return [float(value) if np.isfinite(value) else None for value in values]
