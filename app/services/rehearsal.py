"""Simulated people of known truth walk a study, so that it can be tried before the first real person."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import zip_longest
from threading import Event

import numpy as np
from jaxtyping import Float

from app.errors import AppError
from app.services import study as services
from app.services.export.columns import Row
from app.services.rehearsed_person import Crowd, RehearsedPerson
from app.services.runtime import LiveSession, Runtime
from app.services.summary import Json, summarise
from app.services.walk import walk
from study_core.comparison import Choice
from study_core.conditions import arm_of_rehearsal
from study_core.learning import known_comparisons
from study_core.participants import alignment
from study_core.queries import Provenance, infer_posterior
from study_core.study import Study


class RehearsalStoppedError(AppError):
    """A rehearsal that was given up; what was answered is kept."""


@dataclass(frozen=True)
class Rehearsal:
    """What one simulated person did.

    Attributes:
        summary: Of the session, with the true weights at its end and how well they were found.
        rows: One for each query, for a table; the same whatever else ran at the same time.
    """

    summary: Json
    rows: list[Row]


def rehearse_all(
    runtime: Runtime, study: Study, crowd: Crowd, n_at_once: int, on_answer: Callable[[], None]
) -> Generator[Rehearsal, None, None]:
    """Walks simulated people through whole sessions; gives each rehearsal, in the order of their numbers.

    Close the generator to stop: nobody begins anew, and whoever is under way stops after their next answer.

    Args:
        runtime: The services' resources.
        study: The study.
        crowd: The people.
        n_at_once: How many walk at the same time, each in a thread; what comes out doesn't depend on it.
        on_answer: Called after each answer, from any thread.
    """
    is_over = Event()

    def count() -> None:
        on_answer()
        if is_over.is_set():
            raise RehearsalStoppedError("The rehearsal was stopped; what was answered is kept.")

    pool = ThreadPoolExecutor(n_at_once, thread_name_prefix="rehearsal")
    try:
        numbers = range(1, crowd.n_people + 1)
        walks = [pool.submit(rehearse, runtime, study, crowd, number, count) for number in numbers]
        walks.reverse()
        while walks:
            # Nobody's rows are kept any longer than they are wanted.
            yield walks.pop().result()
    finally:
        is_over.set()
        pool.shutdown(wait=True, cancel_futures=True)


def rehearse(
    runtime: Runtime, study: Study, crowd: Crowd, number: int, on_answer: Callable[[], None]
) -> Rehearsal:
    """Walks the simulated person of that number through a whole session, in one of the study's conditions."""
    arm = study.arms[arm_of_rehearsal(crowd.seed, number, len(study.arms))]
    person = RehearsedPerson(crowd, arm, number)
    _, record = services.join(runtime, arm, rehearsal=f"rehearsal-{crowd.seed}-{number}")
    walk(runtime, record.id, person.answer, on_answer, person.fill)
    live = runtime.live(record.id)
    means = _means_after(runtime, live) if live.state.answers else []
    truth = person.now.weights
    summary = {
        **summarise(runtime, record.id),
        "condition": arm.condition,
        "ending": live.state.ending,
        "true_weights": truth.tolist(),
        "alignment": alignment(means[-1][: len(truth)], truth) if means else None,
    }
    offered = [choice for choice in Choice if any(choice in each.answers for each in study.arms)]
    return Rehearsal(summary, _rows(live, person, means, offered))


def _means_after(runtime: Runtime, live: LiveSession) -> list[Float[np.ndarray, " n_weights"]]:
    """Returns the posterior mean after each answer; answers to test queries don't move it."""
    by_query = {record.query_index: record.mean for record in runtime.store.posteriors(live.record.id)}
    end = live.study.first_test
    if end not in by_query:
        # Nothing is asked after the last active answer, so nobody has needed what it says.
        assert live.state.participant is not None, "the session has begun"
        study = live.study.knowing(live.state.knowledge)
        known = known_comparisons(live.study, live.state)
        last = infer_posterior(study, live.state.participant, end, known)
        by_query[end] = last.mean
    inferred = sorted(by_query)
    after = (
        inferred[bisect_right(inferred, min(index, end - 1))] for index in range(len(live.state.answers))
    )
    return [by_query[index] for index in after]


def _rows(
    live: LiveSession,
    person: RehearsedPerson,
    means: list[Float[np.ndarray, " n_weights"]],
    offered: list[Choice],
) -> list[Row]:
    """Returns what is known about each answered query: what was asked, answered, by whom, and what it taught."""
    names = live.study.domain.feature_names
    rows = []
    for prepared, given, asked, mean in zip(
        live.state.prepared, live.state.answers, person.asked, means, strict=False
    ):
        query, provenance = prepared.proposed.query, prepared.proposed.provenance
        assert isinstance(provenance, Provenance), "simulated people are asked what we chose"
        likely = person.likely(asked, prepared)
        rows.append(
            {
                "study": live.study.name,
                "condition": live.study.condition,
                "participant": live.state.participant,
                "query_index": prepared.query_index,
                "phase": prepared.phase.value,
                "first_shown": prepared.first_shown,
                "repeat_of": prepared.repeat_of,
                "instructed": prepared.instructed,
                "method": provenance.method,
                "visible_difference": provenance.visible_difference,
                "are_distinct": provenance.are_distinct,
                "choice": given.choice.value,
                "probability": likely[given.choice],
                "probability_of": {choice.value: likely.get(choice) for choice in offered},
                "alignment": alignment(mean[: len(names)], asked.weights),
                "feature_difference": dict(zip(names, query.feature_diff.tolist(), strict=True)),
                "posterior_mean": dict(zip_longest(live.study.weight_names, mean.tolist())),
                "true_weight": dict(zip(names, asked.weights.tolist(), strict=True)),
                "true_rationality": float(asked.parameters.rationality[0]),
                "true_lapse_rate": float(asked.parameters.lapse_rate[0]),
                "true_tie_threshold": float(asked.parameters.tie_threshold[0]),
                **asdict(asked.habits),
            }
        )
    return rows
