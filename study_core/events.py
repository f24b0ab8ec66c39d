"""What can happen in a session. Events are facts: frozen, in the past tense, and enough to derive everything else."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from study_core.comparison import Choice
from study_core.online.feature import LearnedFeature
from study_core.path import Ending
from study_core.plan import Phase, Position
from study_core.posterior.population import PopulationPrior
from study_core.queries import Participant, ProposedQuery

MOST_CONFIDENT = 5
"""Confidence goes from 1, a guess, to this."""


class StepOutcome(StrEnum):
    """What became of a step of the path."""

    DONE = "done"
    AGAIN = "again"
    DECLINED = "declined"
    FAILED = "failed"
    SCREENED_OUT = "screened-out"


@dataclass(frozen=True)
class SessionBegun:
    """The person has read the welcome page and pressed Begin.

    Attributes:
        participant: Names the session's random streams: the participant's ordinal, or a rehearsal's label; never a
            secret.
    """

    participant: Participant


@dataclass(frozen=True)
class LanguageChosen:
    """From here on the person reads the study in that language."""

    language: str


@dataclass(frozen=True)
class StepTaken:
    """The person has been through a step of the path that isn't queries, or has tried to.

    Attributes:
        step: Its place in the path, from 0.
        outcome: `again` leaves the person where they are, for another try.
        content: What they answered, and what exactly they had read.
    """

    step: int
    outcome: StepOutcome
    content: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BreakTaken:
    """The person goes on after a break.

    Attributes:
        query_index: The query before which the break was.
    """

    query_index: int


@dataclass(frozen=True)
class QueryPrepared:
    """A query is ready to be shown.

    Attributes:
        query_index: From 0.
        phase: Whether its answer informs the posterior.
        proposed: The query and its provenance.
        clips: SHA-256 of the clip in each picture layout: what exactly is shown, but for the marks at its edge by
            which a page knows it.
        code_version: Version of prefstudy that computed or imported it.
        compute_ms: What it cost, one core; None for an imported query.
        first_shown: The trajectory in the first position on the screen; None where nobody wrote it down: in an
            imported session, and in one kept before sides were drawn, which showed A first.
        repeat_of: Index of the query that this one asks again.
        instructed: What a check tells the person to choose.
        machine: Type of the processor that computed it; None for an imported query, and where nobody wrote it down.
    """

    query_index: int
    phase: Phase
    proposed: ProposedQuery
    clips: dict[str, str]
    code_version: str
    compute_ms: float | None
    first_shown: Choice | None
    repeat_of: int | None = None
    instructed: Position | None = None
    machine: str | None = None

    @property
    def side_shown_first(self) -> Choice:
        """Returns the trajectory that stands in the first position: A where nobody wrote it down."""
        return self.first_shown or Choice.A


@dataclass(frozen=True)
class AnswerGiven:
    """The person chose.

    Attributes:
        query_index: The query that was answered.
        choice: One that the study offers.
        response_time_ms: As measured in the browser; None for an imported answer whose time nobody wrote down.
        confidence: How sure the person is, from 1 to 5, where the study asks it.
    """

    query_index: int
    choice: Choice
    response_time_ms: int | None
    confidence: int | None = None


@dataclass(frozen=True)
class AnswerTakenBack:
    """The person answers the last query again.

    Attributes:
        query_index: That query.
    """

    query_index: int


@dataclass(frozen=True)
class SessionEnded:
    """The session is over before its path is: the person has stopped, or was away for too long.

    Attributes:
        ending: `stopped` or `timed-out`.
    """

    ending: Ending


@dataclass(frozen=True)
class SessionReopened:
    """An experimenter lets the person go on after all, from where they were; however old the session becomes."""


@dataclass(frozen=True)
class PopulationAdopted:
    """The session goes on from what the people before taught; so its log alone derives its queries again.

    Attributes:
        query_index: The first query that is chosen with it.
        key: Name of the shared model.
        learned_from: Ids of the sessions that taught it.
        population: What they taught; None once one of them has been deleted.
    """

    query_index: int
    key: str
    learned_from: tuple[str, ...]
    population: PopulationPrior | None


@dataclass(frozen=True)
class FeatureLearned:
    """The session's own answers have taught a feature, with which it goes on.

    Attributes:
        query_index: The first query that is chosen with it.
        n_queries: It was learned from the answers to so many first queries.
        feature: The feature; None if the training diverged, and the session goes on with what it had.
        code_version: Version of prefstudy that learned it.
        machine: Type of the processor that learned it; None where nobody wrote it down.
    """

    query_index: int
    n_queries: int
    feature: LearnedFeature | None
    code_version: str
    machine: str | None = None


Event = (
    SessionBegun
    | LanguageChosen
    | StepTaken
    | BreakTaken
    | PopulationAdopted
    | FeatureLearned
    | QueryPrepared
    | AnswerGiven
    | AnswerTakenBack
    | SessionEnded
    | SessionReopened
)
