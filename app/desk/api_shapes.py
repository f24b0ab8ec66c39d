"""What the JSON API takes and gives."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import Path
from pydantic import BaseModel, ConfigDict, Field

from app.services.desk_accounts import LONGEST_LABEL
from app.services.desk_people import LONGEST_NOTE, LONGEST_REASON
from app.services.history import Asked as AskedRecord
from app.services.history import Belief as BeliefRecord
from app.services.history import History
from app.services.history import Moment as MomentRecord
from app.services.monitor import Person as PersonRecord
from app.services.monitor import StudySummary, Trouble
from app.services.passwords import LONGEST, SHORTEST
from app.services.reports import ReportState, ReportStatus
from app.store import ApiToken, Arm, AuditEntry, Experimenter, Role, Source, Verdict
from app.store import Review as ReviewRecord
from study_core.plan import Position

SessionId = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="Id of a session.")]
StudyName = Annotated[str, Path(pattern="^[a-z0-9-]+$", max_length=64, description="Name of a study.")]
AccountName = Annotated[str, Path(min_length=1, max_length=64, description="Name of an experimenter.")]
TokenId = Annotated[str, Path(pattern="^[0-9a-f]{16}$", description="Public name of a token.")]


class Shape(BaseModel):
    """What all have in common: nothing is guessed, nothing is ignored."""

    model_config = ConfigDict(extra="forbid")


class ErrorDetail(Shape):
    """What is wrong."""

    code: str = Field(description="For programs.")
    message: str = Field(description="For people: what was expected, and what to do.")


class ErrorShape(Shape):
    """Every error."""

    error: ErrorDetail


class Me(Shape):
    """Whose request it was."""

    name: str
    role: Role
    is_program: bool


class Version(Shape):
    """A version of a study file under which sessions were created."""

    version: str = Field(description="SHA-256 of the study file's text, in hex.")
    created_at: datetime


class Study(Shape):
    """A study of the database."""

    name: str
    title: str
    is_served: bool = Field(description="Whether people can join it here.")
    versions: list[Version]
    n_people: int
    n_completed: int = Field(description="Joined, completed, and neither rejected nor excluded.")
    n_under_way: int
    n_places: int | None

    @classmethod
    def of(cls, summary: StudySummary) -> Study:
        """Returns a study as it is given."""
        # The arms of a version have hashes of their own, which would tell who is in which.
        newest = {record.version: record.created_at for record in reversed(summary.versions)}
        return cls(
            name=summary.name,
            title=summary.title,
            is_served=summary.is_served,
            versions=[Version(version=version, created_at=at) for version, at in reversed(newest.items())],
            n_people=summary.n_people,
            n_completed=summary.n_completed,
            n_under_way=summary.n_under_way,
            n_places=summary.n_places,
        )


class ArmShape(Shape):
    """How many people a condition has; without its name unless conditions were asked for."""

    condition: str | None
    n_completed: int
    n_under_way: int

    @classmethod
    def of(cls, arm: Arm) -> ArmShape:
        """Returns a condition as it is given."""
        return cls(condition=arm.condition, n_completed=arm.n_completed, n_under_way=arm.n_under_way)


class TroubleShape(Shape):
    """A sign of trouble."""

    text: str
    numbers: list[int] = Field(description="Of the people it is about; nobody where it is about the server.")

    @classmethod
    def of(cls, trouble: Trouble) -> TroubleShape:
        """Returns a sign as it is given."""
        return cls(text=trouble.text, numbers=list(trouble.numbers))


class StudyMonitor(Study):
    """A study at a glance."""

    conditions: list[ArmShape]
    troubles: list[TroubleShape]


class Review(Shape):
    """What experimenters have decided about a person."""

    verdict: Verdict | None
    reason: str
    note: str
    revision: int = Field(
        description="Sent back with a change, so that two people don't overwrite each other."
    )
    changed_by: str
    changed_at: datetime | None

    @classmethod
    def of(cls, review: ReviewRecord) -> Review:
        """Returns a review as it is given."""
        return cls(
            verdict=review.verdict,
            reason=review.reason,
            note=review.note,
            revision=review.revision,
            changed_by=review.changed_by,
            changed_at=review.changed_at,
        )


class NewReview(Shape):
    """A change of what is decided about a person."""

    verdict: Verdict | None = None
    reason: str = Field("", max_length=LONGEST_REASON, description="Needed with a verdict.")
    note: str = Field("", max_length=LONGEST_NOTE)
    revision: int = Field(ge=0, le=2**31 - 1, description="The one that was seen.")


class Person(Shape):
    """One person of a study."""

    session_id: str
    number: int
    source: Source
    version: str = Field(description="Of the study file that they met.")
    condition: str | None = Field(description="None unless conditions were asked for.")
    external_id: str | None = Field(description="None for viewers.")
    created_at: datetime
    last_at: datetime | None
    where: str
    ending: str | None
    n_answers: int
    n_queries: int | None
    n_test_answers: int
    held_out_accuracy: float | None
    r_hat: float | None
    ess: float | None
    mean_response_s: float | None
    n_waits: int
    waited_ms: int
    focus_losses: int
    n_repeats: int
    n_repeats_agreed: int
    n_checks: int
    n_checks_passed: int
    n_sided: int
    n_first: int
    signs: list[str]
    review: Review

    @classmethod
    def of(cls, person: PersonRecord, has_ids: bool, has_condition: bool) -> Person:
        """Returns a person as they are given."""
        return cls(**_person(person, has_ids, has_condition))


class Moment(Shape):
    """Something that happened."""

    at: datetime
    what: str

    @classmethod
    def of(cls, moment: MomentRecord) -> Moment:
        """Returns it as it is given."""
        return cls(at=moment.at, what=moment.what)


class Asked(Shape):
    """A question that was asked."""

    query_index: int
    phase: str
    choice: str
    place: Position | None
    response_s: float | None
    waited_s: float | None
    repeat_of: int | None
    has_agreed: bool | None
    has_obeyed: bool | None
    n_hidden: int

    @classmethod
    def of(cls, asked: AskedRecord) -> Asked:
        """Returns it as it is given."""
        return cls(**vars(asked))


class Belief(Shape):
    """What was believed before a question: means and 90 % intervals of the weights."""

    query_index: int
    mean: list[float]
    low: list[float]
    high: list[float]
    r_hat: float | None
    ess: float | None

    @classmethod
    def of(cls, belief: BeliefRecord) -> Belief:
        """Returns it as it is given."""
        return cls(
            query_index=belief.query_index,
            mean=belief.mean.tolist(),
            low=belief.low.tolist(),
            high=belief.high.tolist(),
            r_hat=belief.r_hat,
            ess=belief.ess,
        )


class PersonInFull(Person):
    """One person, with their session as it went."""

    weight_names: list[str]
    moments: list[Moment]
    asked: list[Asked]
    beliefs: list[Belief]

    @classmethod
    def of_history(
        cls, person: PersonRecord, history: History, has_ids: bool, has_condition: bool
    ) -> PersonInFull:
        """Returns a person with their session, as it is given."""
        return cls(
            **_person(person, has_ids, has_condition),
            weight_names=list(history.weight_names),
            moments=[Moment.of(each) for each in history.moments],
            asked=[Asked.of(each) for each in history.asked],
            beliefs=[Belief.of(each) for each in history.beliefs],
        )


class NewLinks(Shape):
    """Whom links are wanted for."""

    ids: list[Annotated[str, Field(min_length=1, max_length=200)]] = Field(min_length=1, max_length=1000)


class PersonalLink(Shape):
    """One person's own link."""

    id: str
    link: str


class Links(Shape):
    """The links that are not one person's."""

    open: str
    prolific: str


class Deleted(Shape):
    """What deleting a person has removed."""

    session_ids: list[str]
    n_answers: int
    n_personal_models: int
    n_shared_models: int
    is_wiped: bool


class Account(Shape):
    """Somebody who may use the desk."""

    name: str
    role: Role
    created_at: datetime

    @classmethod
    def of(cls, experimenter: Experimenter) -> Account:
        """Returns an account as it is given."""
        return cls(name=experimenter.name, role=experimenter.role, created_at=experimenter.created_at)


class NewAccount(Shape):
    """Somebody who shall be let in."""

    name: str = Field(pattern=r"^\w[\w.@+ -]{0,63}$")
    password: str = Field(min_length=SHORTEST, max_length=LONGEST)
    role: Role


class AccountChange(Shape):
    """What is to be different about an account."""

    role: Role


class Token(Shape):
    """A program that is let in."""

    id: str
    experimenter: str
    label: str
    role: Role
    created_at: datetime
    revoked_at: datetime | None

    @classmethod
    def of(cls, token: ApiToken) -> Token:
        """Returns a token as it is given."""
        return cls(**vars(token))


class NewToken(Shape):
    """A program that shall be let in."""

    label: str = Field(min_length=1, max_length=LONGEST_LABEL)
    role: Role


class MadeToken(Token):
    """A new token, with its secret, which is told this once."""

    secret: str


class Entry(Shape):
    """Something that an experimenter did."""

    at: datetime
    who: str
    action: str
    about: str | None
    detail: dict[str, Any]

    @classmethod
    def of(cls, entry: AuditEntry) -> Entry:
        """Returns an entry as it is given."""
        return cls(**vars(entry))


def _person(person: PersonRecord, has_ids: bool, has_condition: bool) -> dict[str, Any]:
    line = person.line
    copied = (
        "last_at",
        "ending",
        "n_answers",
        "r_hat",
        "ess",
        "n_waits",
        "waited_ms",
        "focus_losses",
        "version",
    )
    counts = ("n_repeats", "n_repeats_agreed", "n_checks", "n_checks_passed", "n_sided", "n_first")
    return {name: getattr(line, name) for name in (*copied, *counts)} | {
        "session_id": line.session.id,
        "number": person.number,
        "source": line.session.source,
        "condition": line.condition if has_condition else None,
        "external_id": line.external.external_id if has_ids and line.external is not None else None,
        "created_at": line.session.created_at,
        "where": person.where,
        "n_queries": person.n_queries,
        "n_test_answers": person.n_test,
        "held_out_accuracy": person.accuracy,
        "mean_response_s": person.response_s,
        "signs": list(person.signs),
        "review": Review.of(line.review),
    }


class Report(Shape):
    """A report on the shelf."""

    status: ReportStatus
    people: str = Field(description="Whose sessions it is about.")
    asked_at: datetime | None
    problem: str = Field(description="Why it failed; empty if it didn't.")

    @classmethod
    def of(cls, state: ReportState) -> Report:
        """Returns a report as it is sent."""
        return cls(status=state.status, people=state.people, asked_at=state.asked_at, problem=state.problem)
