"""How long the next query takes after 100 answers, beside the same work done the plain way."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from rich.progress import Progress

from app.bench import information_gain, plain
from app.bench.report import BenchError, provenance, spread
from app.continuation import clip_digests, continue_session
from app.services.continuation import Request
from app.settings import find_study
from study_core.comparison import ComparisonSet
from study_core.lbfgs import maximise
from study_core.participants import draw_person
from study_core.posterior.diagnostics import diagnose
from study_core.posterior.run import Posterior
from study_core.queries import infer_posterior, propose_active_query
from study_core.streams import stream
from study_core.study import Study

N_ANSWERS = 100
_STUDY, _RECOMMENDED_STUDY = "katz2021", "quickstart"
_LARGEST_Z = 4.0

_Value = TypeVar("_Value")


def run(
    seed: int, progress: Progress, n_people: int = 20, n_plain: int = 3, n_answers: int = N_ANSWERS
) -> dict[str, Any]:
    """Measures one continuation of each person's session, one thread, kernels warm.

    Args:
        seed: Of the simulated people and the plain way's own randomness.
        progress: Shows how far it is.
        n_people: How many sessions are continued.
        n_plain: How many of them are continued the plain way as well.
        n_answers: Answers that each person has given before.

    Returns:
        `ratio_to_plain`, how many times longer the plain way takes (medians); `milliseconds` by part, ours and plain,
        asking the paper's way; `recommended_milliseconds`, ours asking as `quickstart` does; `agreement` of the two
        ways' results; `information_gain`, the search for the most informative pair beside APReL's; and where it was
        measured.

    Raises:
        BenchError: Fewer than one person, or more plain repetitions than people.
    """
    if not 1 <= n_plain <= n_people:
        raise BenchError(f"Expected 1 to {n_people} plain repetitions, got {n_plain}.")
    recommended = _by_part(_timed_alone(find_study(_RECOMMENDED_STUDY), seed, n_people, n_answers, progress))
    study = find_study(_STUDY)
    requests = _answered_sessions(study, seed, n_people, n_answers, progress)
    ours: dict[int, tuple[dict[str, float], Posterior]] = {}
    theirs = []
    for number in progress.track(range(n_plain), description="both ways"):
        # In turns, so that whatever else the machine does falls on both.
        for person in range(number, n_people, n_plain):
            ours[person] = _timed_parts(study, requests[person])
        rng = stream(seed, "bench-plain", number)
        theirs.append(plain.next_query(rng, study, requests[number].comparisons))
    our_times = _by_part([times for times, _ in ours.values()])
    plain_times = _by_part([result.milliseconds for result in theirs])
    posteriors = [ours[number][1] for number in range(n_plain)]
    ratio = plain_times["next_query"]["median"] / our_times["next_query"]["median"]
    return {
        "ratio_to_plain": round(ratio, 1),
        "milliseconds": {**our_times, "plain": plain_times},
        "recommended_milliseconds": recommended,
        "repetitions": {"ours": n_people, "plain": n_plain},
        "answers": n_answers,
        "agreement": _agreement(study, posteriors, theirs),
        "information_gain": information_gain.compare(seed, progress, n_plain, n_answers),
        **provenance(seed),
    }


def _timed_alone(
    study: Study, seed: int, n_people: int, n_answers: int, progress: Progress
) -> list[dict[str, float]]:
    """Times one continuation of each person's session, by part."""
    requests = _answered_sessions(study, seed, n_people, n_answers, progress)
    return [_timed_parts(study, request)[0] for request in requests]


def _answered_sessions(
    study: Study, seed: int, n_people: int, n_answers: int, progress: Progress
) -> list[Request]:
    """Returns what is to be computed after the last answer of each person, who has answered real active queries."""
    requests = []
    for number in progress.track(range(1, n_people + 1), description="people answering"):
        person = draw_person(seed, number, study.prior, study.response)
        rng = stream(seed, "bench-answers", number)
        request = Request(study.text, number, 0, ComparisonSet.empty(study.prior.n_features), True, None)
        for index in range(n_answers):
            query = continue_session(request).prepared.proposed.query
            comparisons = request.comparisons.append(query, person.choose(rng, query))
            request = replace(request, query_index=index + 1, comparisons=comparisons)
        requests.append(_still_active(study, request))
    return requests


def _still_active(study: Study, request: Request) -> Request:
    """Names a query of the active phase, so that it is chosen, not looked up; its number only seeds the streams."""
    last = study.protocol.active_queries - 1
    return replace(request, query_index=min(request.query_index, last))


def _timed_parts(study: Study, request: Request) -> tuple[dict[str, float], Posterior]:
    """Times a continuation as a whole, then its parts one by one."""
    whole_ms, continuation = _timed(lambda: continue_session(request))
    names = (study, request.participant, request.query_index)
    posterior_ms, posterior = _timed(lambda: infer_posterior(*names, request.comparisons))
    pair_ms, proposed = _timed(lambda: propose_active_query(*names, posterior))
    first_shown = continuation.prepared.side_shown_first
    clips_ms, clips = _timed(lambda: clip_digests(study.domain, proposed.query, first_shown))
    assert clips == continuation.prepared.clips, "the parts make up the whole"
    times = {
        "next_query": whole_ms,
        "posterior": posterior_ms,
        "pair_and_trajectories": pair_ms,
        "clips": clips_ms,
    }
    return times, posterior


def _timed(compute: Callable[[], _Value]) -> tuple[float, _Value]:
    began = time.perf_counter()
    value = compute()
    return 1e3 * (time.perf_counter() - began), value


def _by_part(repetitions: list[dict[str, float]]) -> dict[str, Any]:
    return {part: spread([times[part] for times in repetitions]) for part in repetitions[0]}


def _agreement(study: Study, posteriors: list[Posterior], theirs: list[plain.PlainQuery]) -> dict[str, Any]:
    """Tells whether both ways computed the same: otherwise comparing their times means nothing."""
    largest_z = max(
        float(_z_of_means(ours, other).max()) for ours, other in zip(posteriors, theirs, strict=True)
    )
    gains = np.concatenate([_gains(study, other) for other in theirs])
    return {
        "posterior_means_largest_z": round(largest_z, 2),
        "posterior_means_agree": largest_z <= _LARGEST_Z,
        "best_reward_ours_minus_plain": {
            "mean": round(float(gains.mean()), 4),
            "smallest": round(float(gains.min()), 4),
            "largest": round(float(gains.max()), 4),
        },
    }


def _z_of_means(ours: Posterior, other: plain.PlainQuery) -> np.ndarray:
    """Returns how many Monte Carlo standard errors lie between the two means of each weight."""
    sd = other.draws.std(axis=0)
    plain_ess = diagnose(other.draws[None], acceptance=float("nan")).ess_bulk
    error = sd * np.sqrt(1.0 / plain_ess + 1.0 / ours.diagnostics.ess_bulk)
    return np.asarray(np.abs(other.draws.mean(axis=0) - ours.mean) / error)


def _gains(study: Study, other: plain.PlainQuery) -> np.ndarray:
    """Returns how much better our optimiser's best drives are, for the plain way's own weights and starts."""
    n_weights, n_starts, n_controls = other.starts.shape
    starts = other.starts.reshape(-1, n_controls)
    weights = np.repeat(other.pair, n_starts, axis=0)
    _, rewards, _, _ = maximise(study.domain, starts, weights)
    return np.asarray(rewards.reshape(n_weights, n_starts).max(axis=1) - np.array(other.rewards))
