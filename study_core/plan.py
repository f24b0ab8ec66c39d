"""Which query comes when in a session, and on which side each trajectory stands: a pure function of study and person.

Practice comes first, then the active queries with the repeats and checks among them, then the common test queries.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from study_core.comparison import Choice
from study_core.queries import Participant
from study_core.streams import stream
from study_core.study import Study

LONGEST_RUN = 3
"""Trajectory A is at most so many times in a row on the same side."""

# A repeat comes so many queries after the first time, where there is room; less where there isn't.
_LAGS = (10, 6, 4, 3, 2)
_TRIES = 20


class Phase(StrEnum):
    """What a query is for. Only answers to active queries inform the posterior."""

    PRACTICE = "practice"
    ACTIVE = "active"
    REPEAT = "repeat"
    CHECK = "check"
    TEST = "test"


class Position(StrEnum):
    """One of the two places on the screen: at the top or the left, and the other."""

    FIRST = "first"
    SECOND = "second"


@dataclass(frozen=True)
class Slot:
    """The place of one query in a session.

    Attributes:
        phase: What the query is for.
        number: Its number among those of its phase, from 0.
        first_shown: The trajectory in the first position.
        repeat_of: Index of the query that is asked again, with its sides swapped.
        instructed: What a check tells people to choose.
    """

    phase: Phase
    number: int
    first_shown: Choice
    repeat_of: int | None = None
    instructed: Position | None = None


@dataclass(frozen=True)
class Plan:
    """The queries of a session.

    Attributes:
        slots: By query index.
    """

    slots: tuple[Slot, ...]

    def __len__(self) -> int:
        """Returns how many queries there are."""
        return len(self.slots)

    @cached_property
    def _active(self) -> tuple[int, ...]:
        return tuple(i for i, slot in enumerate(self.slots) if slot.phase is Phase.ACTIVE)

    @cached_property
    def _end_of_active(self) -> int:
        """Returns the index of the first test query, or of none where there is none."""
        tests = (i for i, slot in enumerate(self.slots) if slot.phase is Phase.TEST)
        return next(tests, len(self.slots))

    def n_active_before(self, query_index: int) -> int:
        """Returns how many active queries come before a query."""
        return bisect_left(self._active, query_index)

    def index_of_active(self, number: int) -> int:
        """Returns the index of the active query of that number, from 0; after the last, of the first test query."""
        return self._active[number] if number < len(self._active) else self._end_of_active

    def needs_posterior(self, query_index: int) -> bool:
        """Returns whether a posterior is inferred before a query: to choose it, or to keep what all answers say."""
        return query_index == self._end_of_active or self.slots[query_index].phase is Phase.ACTIVE


def plan_of(study: Study, participant: Participant) -> Plan:
    """Returns a person's plan.

    Args:
        study: The study.
        participant: Names the session's random streams.
    """
    protocol = study.protocol
    extra = (protocol.repeats, protocol.checks)
    return _plan(
        study.seed, participant, study.n_practice, protocol.active_queries, extra, protocol.test_queries
    )


@lru_cache(maxsize=4096)
def _plan(
    seed: int, participant: Participant, n_practice: int, n_active: int, extra: tuple[int, int], n_test: int
) -> Plan:
    rng = stream(seed, "plan", participant)
    n_main = n_active + sum(extra)
    for lag in (lag for lag in _LAGS for _ in range(_TRIES)):
        sides = _sides(rng, n_practice + n_main + n_test)
        main = range(n_practice, n_practice + n_main)
        checks = _checks(rng, main, extra[1])
        repeats = _repeats(rng, [i for i in main if i not in checks], sides, extra[0], lag)
        if repeats is not None:
            phases = _phases(n_practice, main, n_test, checks, repeats)
            return Plan(tuple(_slots(phases, sides, checks, repeats)))
    raise AssertionError("half of the active queries always find a repeat after a few tries")


def _sides(rng: np.random.Generator, n: int) -> list[Choice]:
    """Returns who stands first, as often A as B in every four queries, and never the same for too long."""
    sides: list[Choice] = []
    while len(sides) < n:
        four = [Choice.A, Choice.A, Choice.B, Choice.B]
        together = sides[-LONGEST_RUN:] + [four[i] for i in rng.permutation(4)]
        if _longest_run(together) <= LONGEST_RUN:
            sides += together[-4:]
    return sides[:n]


def _longest_run(sides: list[Choice]) -> int:
    longest = run = 1
    for before, after in pairwise(sides):
        run = run + 1 if after is before else 1
        longest = max(longest, run)
    return longest


def _checks(rng: np.random.Generator, main: range, n: int) -> dict[int, Position]:
    """Returns where checks stand, and what they tell people to choose; the first query is none."""
    places = rng.choice(np.array(main[1:]), size=n, replace=False).tolist() if n else []
    return {place: list(Position)[rng.integers(2)] for place in sorted(places)}


def _repeats(
    rng: np.random.Generator, places: list[int], sides: list[Choice], n: int, lag: int
) -> dict[int, int] | None:
    """Returns which place repeats which, with swapped sides; None if these sides leave too few."""
    repeats: dict[int, int] = {}
    for place in rng.permutation(places).tolist():
        if len(repeats) == n:
            break
        used = {*repeats, *repeats.values()}
        if place in used:
            continue
        earlier = [i for i in places if i + lag <= place and i not in used and sides[i] is not sides[place]]
        if earlier:
            repeats[place] = int(rng.choice(earlier))
    return repeats if len(repeats) == n else None


def _phases(
    n_practice: int, main: range, n_test: int, checks: dict[int, Position], repeats: dict[int, int]
) -> list[Phase]:
    phases = [Phase.ACTIVE] * len(main)
    for place in checks:
        phases[place - n_practice] = Phase.CHECK
    for place in repeats:
        phases[place - n_practice] = Phase.REPEAT
    return [Phase.PRACTICE] * n_practice + phases + [Phase.TEST] * n_test


def _slots(
    phases: list[Phase], sides: list[Choice], checks: dict[int, Position], repeats: dict[int, int]
) -> Iterator[Slot]:
    n_of = dict.fromkeys(Phase, 0)
    for index, (phase, side) in enumerate(zip(phases, sides, strict=True)):
        yield Slot(phase, n_of[phase], side, repeats.get(index), checks.get(index))
        n_of[phase] += 1


def position_of(first_shown: Choice | None, choice: Choice) -> Position | None:
    """Returns where the chosen trajectory stood; None for an answer that chose neither, or if nobody wrote it down."""
    if first_shown is None or choice not in (Choice.A, Choice.B):
        return None
    return Position.FIRST if choice is first_shown else Position.SECOND


def choice_at(first_shown: Choice, position: Position) -> Choice:
    """Returns the trajectory that stood there."""
    other = Choice.B if first_shown is Choice.A else Choice.A
    return first_shown if position is Position.FIRST else other
