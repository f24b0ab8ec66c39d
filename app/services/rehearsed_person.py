"""A simulated person at a study: who they are, how they answer, and how they go about it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.services.path import ACCEPT, Form
from app.services.runtime import LiveSession
from app.services.walk import agree, items_at
from study_core.comparison import Choice
from study_core.events import MOST_CONFIDENT, AnswerGiven, QueryPrepared
from study_core.participants import NO_HABITS, Habits, SimulatedPerson, draw_person
from study_core.path import ConsentStep, PracticeStep
from study_core.plan import choice_at
from study_core.questionnaire import example_answer, random_answer
from study_core.session import current_step
from study_core.streams import stream
from study_core.study import Study

# Somebody who is in no hurry: what a rehearsed answer's response time is drawn around.
_TYPICAL_RESPONSE_MS = 4000.0
_CARELESS_RESPONSE_MS = 500.0


@dataclass(frozen=True)
class Manners:
    """How simulated people go about a study: shares of them, each in [0, 1].

    Attributes:
        declining: Don't consent.
        leaving: Stop at a query, any as likely as another.
        careless: Answer everything at random, checks and comprehension questions among it, in half a second.
    """

    declining: float = 0.0
    leaving: float = 0.0
    careless: float = 0.0


@dataclass(frozen=True)
class Crowd:
    """Simulated people.

    Attributes:
        seed: With the study and a person's number, decides everything about them.
        n_people: How many; they are numbered from 1.
        habits: What the study's response model doesn't know of.
        rationality: Their beta; None for the study's.
        lapse_rate: Share of answers that they give at random; None for the study's.
        manners: How they go about it.
    """

    seed: int
    n_people: int
    habits: Habits = NO_HABITS
    rationality: float | None = None
    lapse_rate: float | None = None
    manners: Manners = Manners()

    def person(self, study: Study, number: int) -> SimulatedPerson:
        """Returns the person of that number."""
        person = draw_person(
            self.seed, number, study.prior, study.response, study.answers, self.habits, study.domain
        )
        told = {"rationality": self.rationality, "lapse_rate": self.lapse_rate}
        changed = {name: np.array([value]) for name, value in told.items() if value is not None}
        return replace(person, parameters=replace(person.parameters, **changed))


class RehearsedPerson:
    """The simulated person of a number: all they do follows from the crowd's seed and that number."""

    def __init__(self, crowd: Crowd, study: Study, number: int) -> None:
        """Draws who they are.

        Args:
            crowd: To which they belong.
            study: In their condition.
            number: From 1.
        """
        self._study = study
        self._person = crowd.person(study, number)
        manners, shares = crowd.manners, stream(crowd.seed, "simulated-manners", number).random(4)
        self._declines = bool(shares[0] < manners.declining)
        self._is_careless = bool(shares[1] < manners.careless)
        leaves = shares[2] < manners.leaving
        self._stops_before = int(shares[3] * study.n_queries) if leaves else study.n_queries
        self._answers = stream(crowd.seed, "simulated-answers", number)
        self._drift = stream(crowd.seed, "simulated-drift", number)
        self._pages = stream(crowd.seed, "simulated-pages", number)
        self.asked: list[SimulatedPerson] = []
        """The person as they were at each query."""

    @property
    def now(self) -> SimulatedPerson:
        """Returns the person as they are now."""
        return self.asked[-1] if self.asked else self._person

    def answer(self, prepared: QueryPrepared) -> AnswerGiven | None:
        """Returns their answer to a query; None where they stop."""
        if prepared.query_index >= self._stops_before:
            return None
        # One step further on from the query before.
        self.asked.append(self.now.drifted(self._drift) if self.asked else self._person)
        if self._is_careless:
            offered = self._study.answers
            choice, typical = offered[int(self._answers.integers(len(offered)))], _CARELESS_RESPONSE_MS
        else:
            choice = self.now.choose(self._answers, prepared.proposed.query, prepared.side_shown_first)
            choice, typical = _instructed(prepared) or choice, _TYPICAL_RESPONSE_MS
        response_time_ms = int(typical * self._answers.lognormal(0.0, 0.4))
        is_asked_how_sure = self._study.file.answering.confidence and choice not in (
            Choice.UNSURE,
            Choice.SKIP,
        )
        confidence = MOST_CONFIDENT if is_asked_how_sure else None
        return AnswerGiven(prepared.query_index, choice, response_time_ms, confidence)

    def fill(self, live: LiveSession) -> Form:
        """Returns the page that a session is at as they fill it in."""
        step = current_step(live.study, live.state)
        if isinstance(step, ConsentStep):
            return {ACCEPT: ["no" if self._declines else "yes"]}
        is_understood = isinstance(step, PracticeStep) and not self._is_careless
        if is_understood:
            return agree(live)
        screening = any(getattr(item, "screens_out", ()) for item in items_at(live))
        return {
            item.name: [example_answer(item) if screening else random_answer(item, self._pages)]
            for item in items_at(live)
        }

    def likely(self, asked: SimulatedPerson, prepared: QueryPrepared) -> dict[Choice, float]:
        """Returns how likely they were to give each answer to a query.

        Args:
            asked: As they were at that query.
            prepared: The query.
        """
        if self._is_careless:
            return dict.fromkeys(asked.answers, 1.0 / len(asked.answers))
        told = _instructed(prepared)
        if told is None:
            return asked.probabilities(prepared.proposed.query, prepared.side_shown_first)
        return {choice: float(choice is told) for choice in asked.answers}


def _instructed(prepared: QueryPrepared) -> Choice | None:
    """Returns what a check tells people to choose; None for any other query."""
    told = prepared.instructed
    return None if told is None else choice_at(prepared.side_shown_first, told)
