"""Who is evaluated: everyone who has finished, with their active answers and their answers to test queries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.errors import AppError
from app.services.held_out import held_out
from app.services.people import Person as Learner
from app.services.people import is_finished, person
from app.store import SessionRecord, Source, Store
from study_core.domain import Domain
from study_core.evaluation.comparison import n_first
from study_core.evaluation.people import Person
from study_core.predictors.personal_network import FEWEST_ANSWERS
from study_core.published_session import PARTICIPANT_PREFIX
from study_core.study import Study


class NobodyToEvaluateError(AppError):
    """There are no people whose predictions could be scored."""


@dataclass(frozen=True)
class Evaluated:
    """The people of an evaluation.

    Attributes:
        domain: Whose trajectories they compared.
        studies: What they took part in, by hash.
        people: Those who have finished, in the order of their names.
        posterior_samples: The last that were stored, of the hand-coded weights, by person; not of those who have none.
        left_out: Why somebody isn't among them, one sentence each.
    """

    domain: Domain
    studies: dict[str, Study]
    people: list[Person]
    posterior_samples: dict[str, Float[np.ndarray, "n_samples n_features"]]
    left_out: list[str]


def people_to_evaluate(store: Store, study_name: str | None = None, are_rehearsed: bool = False) -> Evaluated:
    """Returns everyone who has finished: rehearsed people, or all others.

    Args:
        store: Where the answers are.
        study_name: Only people of studies of this name; everyone unless told.
        are_rehearsed: Whether to try the evaluation on rehearsed people.

    Raises:
        NobodyToEvaluateError: Nobody has finished, or people compared trajectories of different domains.
    """
    records = store.sessions() if study_name is None else store.sessions_of_study_named(study_name)
    if study_name is not None and not records:
        raise NobodyToEvaluateError(f"Nobody here has begun a study named '{study_name}'. Check the name.")
    finished = [
        record
        for record in records
        if (record.source is Source.REHEARSED) is are_rehearsed and is_finished(store, record)
    ]
    known = [person(store, record) for record in finished]
    domains = {one.study.domain.id: one.study.domain for one in known}
    if len(domains) > 1:
        raise NobodyToEvaluateError(
            f"Expected people of one domain, got {' and '.join(sorted(domains))}. Name one --study."
        )
    names = sorted({one.study.name for one in known})
    if len(names) > 1:
        raise NobodyToEvaluateError(
            f"Expected people of one study, whose test queries are the same, got {' and '.join(names)}. "
            "Name one --study."
        )
    people, samples, left_out = [], {}, []
    studies: dict[str, Study] = {}
    verdicts = _verdicts(store, {one.study.name for one in known})
    for record, name, one in zip(finished, _names(known), known, strict=True):
        if record.id in verdicts:
            left_out.append(f"Person {name} was {verdicts[record.id]}.")
            continue
        found = Person(name, one.training, held_out(store, record))
        reason = _unfit(found)
        if reason:
            left_out.append(reason)
            continue
        people.append(found)
        studies[record.study_hash] = one.study
        posteriors = store.posteriors(record.id)
        if posteriors:
            samples[name] = posteriors[-1].samples[:, : len(one.study.domain.feature_names)]
    if not people:
        raise NobodyToEvaluateError(" ".join(["Nobody here can be evaluated.", *left_out, _remedy(records)]))
    people.sort(key=_in_order)
    return Evaluated(next(iter(domains.values())), studies, people, samples, left_out)


def number(known: Learner) -> str:
    """Returns what a person is called in reports: their number in their study, or in the published data."""
    return str(known.participant).removeprefix(PARTICIPANT_PREFIX)


def _verdicts(store: Store, study_names: Iterable[str]) -> dict[str, str]:
    """Returns, by session, what was decided against people, with the reason."""
    against = {key: review for name in study_names for key, review in store.reviews_against(name).items()}
    return {key: f"{review.verdict}: {review.reason}" for key, review in against.items()}


def _remedy(records: Sequence[SessionRecord]) -> str:
    if any(record.source is Source.REHEARSED for record in records):
        return "Import or finish some sessions first; rehearsed people count only with --people rehearsed."
    return "Import or finish some sessions first."


def _names(known: Sequence[Learner]) -> Iterator[str]:
    """Gives each person's number in their study, with the study's name where two have the same."""
    numbers = [number(one) for one in known]
    counts = Counter(numbers)
    for one, its_number in zip(known, numbers, strict=True):
        yield its_number if counts[its_number] == 1 else f"{one.study.name}-{its_number}"


def _in_order(one: Person) -> tuple[int, str]:
    return (int(one.name), "") if one.name.isdecimal() else (0, one.name)


def _unfit(one: Person) -> str:
    """Returns why somebody can't be evaluated; empty if they can."""
    n = len(one.training)
    # Predictors are compared after the first part of the answers, from which each must be able to learn.
    if n_first(n) < FEWEST_ANSWERS:
        needed = next(most for most in range(n, 100 * FEWEST_ANSWERS) if n_first(most) >= FEWEST_ANSWERS)
        return f"Person {one.name} has {n} active answers that prefer a side; {needed} are needed."
    if len(one.test) == 0:
        return f"Person {one.name} has no answer to a common test query that prefers a side."
    return ""
