"""Where a session stands: what a monitor shows of it, written with every change of its log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.store import NewReport, PosteriorRecord, SessionDeletedError, Standing, Store
from study_core import session_codec
from study_core.comparison import Choice
from study_core.conduct import conduct_of, reasons_to_exclude
from study_core.events import AnswerGiven, Event, QueryPrepared
from study_core.path import Ending
from study_core.plan import Phase
from study_core.session import Action, SessionState, next_action, reduce
from study_core.study import Study, parse_study

_NO_SIDE = "-"
_MOST_TIMES_HIDDEN = 10_000


def standing_of(
    study: Study,
    state: SessionState,
    events: Sequence[Event] = (),
    posterior: PosteriorRecord | None = None,
    report: NewReport | None = None,
) -> Standing:
    """Returns where a session stands.

    Args:
        study: The study.
        state: What its log says.
        events: What has just happened, last in the log.
        posterior: The posterior that came with it.
        report: What the browser measured meanwhile.
    """
    conduct = conduct_of(state)
    asked = zip(state.prepared, state.answers, strict=False)
    return Standing(
        step=state.step,
        n_answers=len(state.answers),
        test_answers="".join(_letter(given) for query, given in asked if query.phase is Phase.TEST),
        n_repeats=conduct.n_repeats,
        n_repeats_agreed=conduct.n_repeats_agreed,
        n_checks=conduct.n_checks,
        n_checks_passed=conduct.n_checks_passed,
        n_sided=conduct.n_sided,
        n_first=conduct.n_first,
        response_ms=conduct.response_ms,
        is_wait=_is_wait(study, state, events),
        focus_losses=0 if report is None else times_hidden(report.measures),
        **({} if posterior is None else _learned(posterior)),
    )


def exclusion_after(study: Study, state: SessionState) -> str | None:
    """Returns why whoever has just completed is left out of the analysis by their study file; None if they aren't."""
    if state.ending is not Ending.COMPLETED:
        return None
    return "; ".join(reasons_to_exclude(study.file.exclusion, conduct_of(state))) or None


def catch_up(store: Store, on_session: Callable[[], None] = lambda: None) -> int:
    """Writes where the sessions stand of which that isn't known: imported ones, and those of an older schema.

    Returns:
        How many.
    """
    known = store.standing_lengths()
    missing = [record for record in store.sessions() if record.id not in known]
    for record in missing:
        study = parse_study(store.study_text(record.study_hash))
        try:
            stored = store.events(record.id)
            state = reduce(study, (session_codec.from_json(event.kind, event.payload) for event in stored))
            posteriors = store.posteriors(record.id)
            last = posteriors[-1] if posteriors else None
            store.put_standing(record.id, state.n_events, standing_of(study, state, posterior=last))
        except SessionDeletedError:
            continue
        on_session()
    return len(missing)


def _letter(given: AnswerGiven) -> str:
    return given.choice.value if given.choice in (Choice.A, Choice.B) else _NO_SIDE


def _is_wait(study: Study, state: SessionState, events: Sequence[Event]) -> bool:
    """Returns whether a question comes on its own, after what was done before it: somebody has waited for it."""
    is_prepared = bool(events) and isinstance(events[-1], QueryPrepared)
    is_alone = not any(isinstance(event, AnswerGiven) for event in events)
    return is_prepared and is_alone and bool(state.answers) and next_action(study, state) is Action.ASK


def times_hidden(measures: Mapping[str, Any]) -> int:
    """Returns how often a page was hidden, as far as what its browser sent can be believed: nobody vouches for it."""
    n_times = measures.get("hidden")
    return n_times if type(n_times) is int and 0 <= n_times < _MOST_TIMES_HIDDEN else 0


def worst_r_hat(posterior: PosteriorRecord) -> float | None:
    """Returns the largest R-hat of a posterior; None where none is known."""
    return max((value for value in posterior.summary.get("r_hat") or () if value is not None), default=None)


def least_ess(posterior: PosteriorRecord) -> float | None:
    """Returns the smallest effective sample size of a posterior; None where none is known."""
    return min(
        (value for value in posterior.summary.get("ess_bulk") or () if value is not None), default=None
    )


def _learned(posterior: PosteriorRecord) -> dict[str, Any]:
    return {"mean": posterior.mean, "r_hat": worst_r_hat(posterior), "ess": least_ess(posterior)}
