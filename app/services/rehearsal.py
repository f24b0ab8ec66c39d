"""Simulated people of known truth walk a study, so that it can be tried before the first real person."""

from __future__ import annotations

from collections.abc import Callable

from app.services import study as services
from app.services.runtime import Runtime
from app.services.summary import Json, summarise
from app.services.walk import walk
from study_core.comparison import Choice
from study_core.participants import alignment, draw_person
from study_core.session import QueryPrepared
from study_core.streams import stream
from study_core.study import Study

# Somebody who is no hurry: what a rehearsed answer's response time is drawn around.
_TYPICAL_RESPONSE_MS = 4000.0


def rehearse(runtime: Runtime, study: Study, seed: int, number: int, on_answer: Callable[[], None]) -> Json:
    """Walks one simulated person through a whole session; returns its summary and the truth.

    Args:
        runtime: The services' resources.
        study: The study.
        seed: Of the simulated people; with the study it decides everything.
        number: Which of them, from 1.
        on_answer: Called after each answer.
    """
    person = draw_person(seed, number, study.prior, study.response)
    rng = stream(seed, "simulated-answers", number)
    _, record = services.join(runtime, study, rehearsal=f"rehearsal-{seed}-{number}")

    def answer(prepared: QueryPrepared) -> tuple[Choice, int]:
        choice = person.choose(rng, prepared.proposed.query)
        return choice, int(_TYPICAL_RESPONSE_MS * rng.lognormal(0.0, 0.4))

    walk(runtime, record.id, answer, on_answer)
    summary = summarise(runtime, record.id)
    estimate = runtime.store.posteriors(record.id)[-1].mean
    return {
        **summary,
        "true_weights": person.weights.tolist(),
        "alignment": alignment(estimate, person.weights),
    }
