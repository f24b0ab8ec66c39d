"""What a study will do when it is run: what people are asked, how long it takes them, what it costs."""

from __future__ import annotations

import time
from dataclasses import dataclass

from app.services.continuation import ContinueFn, Request
from app.services.duration import SECONDS_PER_QUERY, expected_minutes
from app.settings import STATIC
from study_core.comparison import Choice, ComparisonSet
from study_core.path import questionnaire_of, text_of
from study_core.plan import Phase, plan_of
from study_core.study import Study

_PLACEHOLDER = "CHANGE-ME"
_READY_CONSENT = "The consent page is the ready one, which is only an example: write your own."


@dataclass(frozen=True)
class Outlook:
    """What a study will do.

    Attributes:
        version: SHA-256 of the study file's text, in hex.
        conditions: Names of its arms; empty without any.
        n_queries: Of each phase, practice among them.
        pages: What people meet on their way, in order.
        languages: In which they can read it.
        minutes: About how long it takes them.
        places: Completed sessions wanted; None for any number.
        payment: What each is paid, such as `6.00 EUR`; None where the file doesn't say.
        hourly_pay: What that is an hour, in the same currency.
        cost: Of all places together, with the recruiting service's fee; None where that isn't known.
    """

    version: str
    conditions: tuple[str, ...]
    n_queries: dict[str, int]
    pages: tuple[str, ...]
    languages: tuple[str, ...]
    minutes: int
    places: int | None
    payment: str | None
    hourly_pay: str | None
    cost: str | None


def outlook(study: Study) -> Outlook:
    """Returns what a study will do."""
    plan = plan_of(study, 1)
    minutes, places, payment = expected_minutes(study), study.file.recruitment.places, study.file.payment
    cost = None
    if payment is not None and places is not None:
        cost = _money(places * payment.amount * (1.0 + payment.fee), payment.currency)
    return Outlook(
        version=study.version,
        conditions=tuple(each.name for each in study.file.condition),
        n_queries={phase.value: sum(slot.phase is phase for slot in plan.slots) for phase in Phase},
        pages=tuple(_pages(study)),
        languages=study.languages,
        minutes=minutes,
        places=places,
        payment=None if payment is None else _money(payment.amount, payment.currency),
        hourly_pay=None if payment is None else _money(payment.amount * 60.0 / minutes, payment.currency),
        cost=cost,
    )


def seconds_per_query(study: Study, continue_fn: ContinueFn, n_queries: int = 5) -> float:
    """Returns what the next query costs one core of this machine: the median after a few answers.

    In the middle of a long study it costs somewhat more, since the posterior has more answers to go through.

    Args:
        study: The study; of one with conditions, the first arm.
        continue_fn: Computes a query.
        n_queries: How many are timed, the first left out.
    """
    arm, times = study.arms[0], []
    answers = ComparisonSet.empty(len(arm.domain.feature_names))
    index = plan_of(arm, 1).index_of_active(0)
    for _ in range(n_queries + 1):
        started = time.perf_counter()
        done = continue_fn(Request(arm.text, 1, index, answers, True, None))
        times.append(time.perf_counter() - started)
        answers = answers.append(done.prepared.proposed.query, Choice.A)
    return sorted(times[1:])[n_queries // 2]


def compute(study: Study, seconds: float) -> dict[str, float | int]:
    """Returns what a study asks of the machine.

    Args:
        study: The study.
        seconds: What a query costs one core.
    """
    n_answers = max(len(arm.answers) for arm in study.arms)
    # Every answer is computed ahead, in the time that somebody takes for one.
    return {
        "seconds_per_query": round(seconds, 3),
        "people_at_once_per_core": max(1, int(SECONDS_PER_QUERY / (n_answers * seconds))),
    }


def advice(study: Study) -> list[str]:
    """Returns what an experimenter may have forgotten, one sentence each."""
    file, steps = study.file, {step.step for step in study.file.path}
    codes = [ending.code for ending in file.endings.values() if ending.code]
    to_change = [code for code in codes if _PLACEHOLDER in code]
    notes = (
        ("consent" not in steps, 'Nobody is asked for consent: the path has no step "consent".'),
        ("consent" in steps and _is_ready_text(study, "consent"), _READY_CONSENT),
        (not codes, "No ending has a completion code, which services such as Prolific ask for."),
        (bool(to_change), f"Completion codes are still to be changed: {', '.join(to_change)}."),
        (file.protocol.test_queries == 0, "Without test queries, no accuracy on held-out answers is known."),
        (file.recruitment.places is None, "Anybody with the link can join: recruitment.places isn't set."),
    )
    return [note for is_so, note in notes if is_so]


def _is_ready_text(study: Study, name: str) -> bool:
    language = study.languages[0]
    ready = STATIC / "texts" / f"{name}.{language}.md"
    return ready.is_file() and study.text_named(name, language) == ready.read_text(encoding="utf-8")


def _pages(study: Study) -> list[str]:
    pages = ["welcome"]
    for step in study.file.path:
        shown = questionnaire_of(step) or text_of(step)
        pages.append(step.step if shown in (None, step.step) else f"{step.step} ({shown})")
    return [*pages, "last page"]


def _money(amount: float, currency: str) -> str:
    return f"{amount:,.2f} {currency}"
