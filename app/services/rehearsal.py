"""Simulated people of known truth walk a study, so that it can be tried before the first real person."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest
from threading import Event

import numpy as np
from jaxtyping import Float

from app.errors import AppError
from app.services import study as services
from app.services.runtime import LiveSession, Runtime
from app.services.summary import Json, summarise
from app.services.table import Row
from app.services.walk import walk
from study_core.comparison import Choice
from study_core.events import MOST_CONFIDENT, AnswerGiven, QueryPrepared
from study_core.learning import known_comparisons
from study_core.participants import NO_HABITS, Habits, SimulatedPerson, alignment, draw_person
from study_core.plan import choice_at
from study_core.queries import Provenance, infer_posterior
from study_core.streams import stream
from study_core.study import Study

# Somebody who is in no hurry: what a rehearsed answer's response time is drawn around.
_TYPICAL_RESPONSE_MS = 4000.0


class RehearsalStoppedError(AppError):
    """A rehearsal that was given up; what was answered is kept."""


@dataclass(frozen=True)
class Crowd:
    """Simulated people.

    Attributes:
        seed: With the study and a person's number, decides everything about them.
        n_people: How many; they are numbered from 1.
        habits: What the study's response model doesn't know of.
        rationality: Their beta; None for the study's.
        lapse_rate: Share of answers that they give at random; None for the study's.
    """

    seed: int
    n_people: int
    habits: Habits = NO_HABITS
    rationality: float | None = None
    lapse_rate: float | None = None

    def person(self, study: Study, number: int) -> SimulatedPerson:
        """Returns the person of that number."""
        person = draw_person(
            self.seed, number, study.prior, study.response, study.answers, self.habits, study.domain
        )
        told = {"rationality": self.rationality, "lapse_rate": self.lapse_rate}
        changed = {name: np.array([value]) for name, value in told.items() if value is not None}
        return replace(person, parameters=replace(person.parameters, **changed))


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
    """Walks the simulated person of that number through a whole session."""
    person = crowd.person(study, number)
    answers_rng = stream(crowd.seed, "simulated-answers", number)
    drift_rng = stream(crowd.seed, "simulated-drift", number)
    asked: list[SimulatedPerson] = []

    def answer(prepared: QueryPrepared) -> AnswerGiven:
        # The person as they are now, one step further on from the query before.
        asked.append(asked[-1].drifted(drift_rng) if asked else person)
        choice = asked[-1].choose(answers_rng, prepared.proposed.query, prepared.side_shown_first)
        choice = _instructed(prepared) or choice
        response_time_ms = int(_TYPICAL_RESPONSE_MS * answers_rng.lognormal(0.0, 0.4))
        confidence = MOST_CONFIDENT if study.file.answering.confidence else None
        return AnswerGiven(prepared.query_index, choice, response_time_ms, confidence)

    _, record = services.join(runtime, study, rehearsal=f"rehearsal-{crowd.seed}-{number}")
    walk(runtime, record.id, answer, on_answer)
    live = runtime.live(record.id)
    means = _means_after(runtime, live)
    truth = asked[-1].weights
    summary = {
        **summarise(runtime, record.id),
        "true_weights": truth.tolist(),
        "alignment": alignment(means[-1][: len(truth)], truth),
    }
    return Rehearsal(summary, _rows(live, asked, means))


def _instructed(prepared: QueryPrepared) -> Choice | None:
    """Returns what a check tells people to choose, which simulated people do; None for any other query."""
    told = prepared.instructed
    return None if told is None else choice_at(prepared.side_shown_first, told)


def _likely(person: SimulatedPerson, prepared: QueryPrepared) -> dict[Choice, float]:
    """Returns how likely somebody was to give each answer."""
    told = _instructed(prepared)
    if told is None:
        return person.probabilities(prepared.proposed.query, prepared.side_shown_first)
    return {choice: float(choice is told) for choice in person.answers}


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
    live: LiveSession, asked: list[SimulatedPerson], means: list[Float[np.ndarray, " n_weights"]]
) -> list[Row]:
    """Returns what is known about each query: what was asked and answered, by whom, and what it taught."""
    names = live.study.domain.feature_names
    rows = []
    for prepared, given, person, mean in zip(
        live.state.prepared, live.state.answers, asked, means, strict=True
    ):
        query, provenance = prepared.proposed.query, prepared.proposed.provenance
        assert isinstance(provenance, Provenance), "simulated people are asked what we chose"
        likely = _likely(person, prepared)
        rows.append(
            {
                "study": live.study.name,
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
                "probability_of": {choice.value: value for choice, value in likely.items()},
                "alignment": alignment(mean[: len(names)], person.weights),
                "feature_difference": dict(zip(names, query.feature_diff.tolist(), strict=True)),
                "posterior_mean": dict(zip_longest(live.study.weight_names, mean.tolist())),
                "true_weight": dict(zip(names, person.weights.tolist(), strict=True)),
                "true_rationality": float(person.parameters.rationality[0]),
                "true_lapse_rate": float(person.parameters.lapse_rate[0]),
                "true_tie_threshold": float(person.parameters.tie_threshold[0]),
                **asdict(person.habits),
            }
        )
    return rows
