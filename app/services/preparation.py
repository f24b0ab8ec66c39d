"""Keeping the next query ready: it is computed for every possible answer while the person watches."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from app.services import learning
from app.services.computations import has_succeeded, then
from app.services.continuation import Computation, Continuation, Request
from app.services.runtime import LiveSession, OpenStudy, Runtime
from app.store import PopulationWithdrawnError, PositionTakenError, PosteriorRecord, SessionDeletedError
from study_core.choice import PARAMETER_PRIORS, ResponseParameters
from study_core.comparison import Choice, ComparisonSet
from study_core.events import AnswerGiven, BreakTaken, Event, FeatureLearned, QueryPrepared
from study_core.learning import compared
from study_core.plan import Phase
from study_core.posterior.run import Posterior
from study_core.queries import ProposedQuery
from study_core.session import Action, SessionState, apply, needs_query, next_action, session_plan

log = logging.getLogger(__name__)

# A person who waits comes before anything that is computed ahead.
_WAITED_FOR = 10.0
_AHEAD = 0.0

_LEVELS = (0.05, 0.5, 0.95)


def go_on(runtime: Runtime, live: LiveSession) -> None:
    """Sets going whatever a session needs next; the caller holds its lock."""
    prepare(runtime, live)
    if live.state.current is not None and not live.ahead:
        look_ahead(runtime, live)


def give_up(live: LiveSession, but: Computation | None = None) -> None:
    """Gives up what is being computed for a session but for one computation; the caller holds its lock."""
    for computation in live.ahead.values():
        if computation is not but:
            computation.cancel()
    live.ahead = {}


def look_ahead(runtime: Runtime, live: LiveSession) -> None:
    """Starts computing what follows the current query, for each answer that makes a difference."""
    current = live.state.current
    live.ahead = {}
    following = live.state.query_index + 1
    is_over = live.state.ending is not None
    if current is None or is_over or following >= live.study.n_queries:
        return
    learning.begin_early(runtime, live)
    if not session_plan(live.study, live.state).needs_posterior(following):
        live.ahead[None] = _submit(runtime, request_of(live.opened, live.state, following), _AHEAD)
        return
    feature = learning.feature_before(runtime, live, live.state, following)
    if feature is not None and not has_succeeded(feature):
        # One that has failed is learned again for whoever waits for it.
        if not feature.done():
            feature.add_done_callback(lambda _: runtime.hand_over(_look_ahead_from, runtime, live, current))
        return
    learned = None if feature is None else feature.result()
    requests = {
        choice: request_of(live.opened, _after(live, choice), following, learned)
        for choice in live.study.answers
    }
    # Answers that say nothing, and all that don't inform the posterior, lead to the same query, which has one key.
    by_key = {request.key: request for request in requests.values()}
    begun = dict(
        zip(by_key, runtime.engine.submit_together(runtime.continue_fn, by_key, _AHEAD), strict=True)
    )
    live.ahead = {choice: begun[request.key] for choice, request in requests.items()}


def continuation_after(
    runtime: Runtime, live: LiveSession, choice: Choice, after: SessionState
) -> Computation:
    """Returns the continuation after an answer to the current query, begun now if it wasn't before.

    The one for the other answer is given up.

    Args:
        runtime: The services' resources.
        live: The session; the caller holds its lock.
        choice: The answer.
        after: The session's state once the answer is taken.
    """
    chosen = live.ahead.get(choice) or live.ahead.get(None)
    give_up(live, but=chosen)
    if chosen is not None and chosen.done():
        return chosen
    # Submitted again, what was begun ahead goes before everything that nobody waits for yet.
    return _begin(runtime, live, after)


def prepare(runtime: Runtime, live: LiveSession) -> None:
    """Makes sure that a session that needs a query gets one; the caller holds its lock."""
    if not needs_query(live.study, live.state) or None in live.ahead:
        return
    computation = _begin(runtime, live, live.state)
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

    computation.add_done_callback(lambda _: runtime.hand_over(_deliver, runtime, live, computation))


def _deliver(runtime: Runtime, live: LiveSession, computation: Computation) -> None:
    with live.lock:
        # An answer that was taken back has called for another query meanwhile.
        if live.ahead.get(None) is not computation:
            return
        # What is delivered now must not be taken for what follows it by an answer that comes at once.
        live.ahead = {}
        try:
            continuation: Continuation = computation.result()
        except Exception:
            runtime.health.failed()
            # The log is whole: the next request for this session's screen starts the computation again.
            log.exception("session %s: the next query could not be computed", live.record.id)
            return
        is_next = continuation.prepared.query_index == live.state.query_index
        if not is_next or not needs_query(live.study, live.state):
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


def entry(continuation: Continuation) -> tuple[list[Event], PosteriorRecord | None]:
    """Returns what a continuation adds to the log, and the posterior that is stored with it."""
    prepared, posterior = continuation.prepared, continuation.posterior
    events: list[Event] = [prepared] if continuation.learned is None else [continuation.learned, prepared]
    return events, None if posterior is None else posterior_record(prepared.query_index, posterior)


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
    parameters = np.column_stack([getattr(posterior.parameters, name) for name in PARAMETER_PRIORS])
    # Those that no sample differs in are the summary's, to the last bit.
    differ = bool((parameters != parameters[0]).any())
    return PosteriorRecord(
        query_index, posterior.mean, posterior.samples, summary, parameters if differ else None
    )


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


def _after(live: LiveSession, choice: Choice) -> SessionState:
    """Returns the state that an answer to the current query would lead to, be it after a break."""
    state = live.state
    if next_action(live.study, state) is Action.BREAK:
        state = apply(live.study, state, BreakTaken(state.query_index))
    return apply(live.study, state, AnswerGiven(state.query_index, choice, None))


def _begin(runtime: Runtime, live: LiveSession, state: SessionState) -> Computation:
    """Starts computing the next query of a state for somebody who waits for it."""
    index = state.query_index

    def begin_with(learned: FeatureLearned | None) -> Computation:
        return _submit(runtime, request_of(live.opened, state, index, learned), _WAITED_FOR)

    feature = learning.feature_before(runtime, live, state, index)
    if feature is None:
        return begin_with(None)
    if has_succeeded(feature):
        return begin_with(feature.result())
    return then(runtime.hand_over, feature, begin_with)


def request_of(
    opened: OpenStudy, state: SessionState, query_index: int, learned: FeatureLearned | None = None
) -> Request:
    """Returns what the next query of a session is computed from.

    Args:
        opened: The session's study.
        state: What the log says.
        query_index: The query.
        learned: A feature that the session goes on with from this query on.
    """
    assert state.participant is not None, "a session that has not begun needs no query"
    study, given = opened.study, _given_query(opened, state, query_index)
    text, participant = study.text, state.participant
    if not session_plan(study, state).needs_posterior(query_index):
        # What isn't used is left out, so that the same computation has the same name.
        nothing = ComparisonSet.empty(len(study.domain.feature_names))
        return Request(text, participant, query_index, nothing, False, given)
    knowledge = state.knowledge
    if learned is not None and learned.feature is not None:
        knowledge = replace(knowledge, feature=learned.feature)
    judged = None if knowledge.feature is None else compared(state, query_index)
    return Request(text, participant, query_index, state.comparisons, True, given, knowledge, learned, judged)


def _given_query(opened: OpenStudy, state: SessionState, query_index: int) -> ProposedQuery | None:
    """Returns a query that need not be chosen: of the common test set, or one that is asked again."""
    slot = session_plan(opened.study, state).slots[query_index]
    if slot.phase is Phase.TEST:
        return opened.test_set[slot.number]
    return None if slot.repeat_of is None else state.prepared[slot.repeat_of].proposed


def _submit(runtime: Runtime, request: Request, urgency: float) -> Computation:
    return runtime.engine.submit(request.key, runtime.continue_fn, request, urgency)


def _finite(values: np.ndarray) -> list[float | None]:
    """Returns numbers as JSON knows them; what isn't finite (a quantity that never moved) is null."""
    return [float(value) if np.isfinite(value) else None for value in values]
