"""How somebody went about a study: whether they read it, agree with themselves, and look at both sides.

A study file can name beforehand what leads to exclusion from the analysis; it is applied when somebody completes.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

from study_core.plan import Position, position_of
from study_core.session import SessionState
from study_core.study_file import ExclusionSection


@dataclass(frozen=True)
class Conduct:
    """Counts over the answers that stand, practice among them.

    Attributes:
        n_repeats: Repeated queries answered.
        n_repeats_agreed: Those of them answered as the first time.
        n_checks: Checks answered.
        n_checks_passed: Those of them answered as told.
        n_sided: Answers that chose a side, to queries whose sides are known.
        n_first: Those of them that chose what stood first.
        response_ms: Sum of all response times.
        median_response_ms: Their median; None without any.
    """

    n_repeats: int
    n_repeats_agreed: int
    n_checks: int
    n_checks_passed: int
    n_sided: int
    n_first: int
    response_ms: int
    median_response_ms: float | None


def conduct_of(state: SessionState) -> Conduct:
    """Returns how somebody has gone about a study so far."""
    asked = list(zip(state.prepared, state.answers, strict=False))
    agreed = [
        given.choice is state.answers[query.repeat_of].choice
        for query, given in asked
        if query.repeat_of is not None
    ]
    passed = [
        position_of(query.first_shown, given.choice) is query.instructed
        for query, given in asked
        if query.instructed is not None
    ]
    sides = [position_of(query.first_shown, given.choice) for query, given in asked]
    times = [given.response_time_ms for given in state.answers if given.response_time_ms is not None]
    return Conduct(
        n_repeats=len(agreed),
        n_repeats_agreed=sum(agreed),
        n_checks=len(passed),
        n_checks_passed=sum(passed),
        n_sided=sum(side is not None for side in sides),
        n_first=sides.count(Position.FIRST),
        response_ms=sum(times),
        median_response_ms=float(median(times)) if times else None,
    )


def reasons_to_exclude(wanted: ExclusionSection, conduct: Conduct) -> tuple[str, ...]:
    """Returns which of a study file's criteria somebody doesn't meet, one phrase each; none for whoever counts."""
    one_side = max(conduct.n_first, conduct.n_sided - conduct.n_first)
    shares = (
        ("checks passed", wanted.least_checks_passed, conduct.n_checks_passed, conduct.n_checks),
        ("repeats agreed", wanted.least_repeats_agreed, conduct.n_repeats_agreed, conduct.n_repeats),
    )
    reasons = [
        f"{name}: {n} of {total}, expected a share of {least:g}"
        for name, least, n, total in shares
        if least is not None and n < least * total
    ]
    if wanted.most_one_side is not None and one_side > wanted.most_one_side * conduct.n_sided:
        most = wanted.most_one_side
        reasons.append(
            f"one side chosen: {one_side} of {conduct.n_sided}, expected a share of at most {most:g}"
        )
    least_ms, median_ms = wanted.least_median_response_ms, conduct.median_response_ms
    if least_ms is not None and median_ms is not None and median_ms < least_ms:
        reasons.append(f"median response time: {median_ms:.0f} ms, expected at least {least_ms}")
    return tuple(reasons)
