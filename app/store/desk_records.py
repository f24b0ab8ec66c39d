"""What the store keeps of experimenters and of what they do: frozen plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.store.records import ExternalPerson, SessionRecord


class Role(StrEnum):
    """What an experimenter may do: a viewer looks, an assistant runs the study, an owner decides about everything."""

    VIEWER = "viewer"
    ASSISTANT = "assistant"
    OWNER = "owner"

    def may_act_as(self, role: Role) -> bool:
        """Returns whether this role includes that one."""
        order = list(Role)
        return order.index(self) >= order.index(role)


class Verdict(StrEnum):
    """Why a session doesn't count: its work isn't accepted, or it is left out of the analysis."""

    REJECTED = "rejected"
    EXCLUDED = "excluded"


@dataclass(frozen=True)
class Experimenter:
    """Somebody who may use the desk.

    Attributes:
        name: What they log in with; 1 to 64 characters.
        role: What they may do.
        created_at: Since when, aware, UTC.
    """

    name: str
    role: Role
    created_at: datetime


@dataclass(frozen=True)
class ApiToken:
    """A program that an experimenter lets in.

    Attributes:
        id: Public name of the token.
        experimenter: Whose it is.
        label: What they call it.
        role: What the program may do; never more than they may.
        created_at: Since when, aware, UTC.
        revoked_at: Until when; None while it holds.
    """

    id: str
    experimenter: str
    label: str
    role: Role
    created_at: datetime
    revoked_at: datetime | None


@dataclass(frozen=True)
class Review:
    """What experimenters have decided about a session.

    Attributes:
        verdict: Why it doesn't count; None if it does.
        reason: Of the verdict.
        note: Whatever they want to remember.
        revision: How often it was changed; whoever changes it says which revision they saw.
        changed_by: Name of whoever changed it last; empty before the first change.
        changed_at: When, aware, UTC.
    """

    verdict: Verdict | None = None
    reason: str = ""
    note: str = ""
    revision: int = 0
    changed_by: str = ""
    changed_at: datetime | None = None


@dataclass(frozen=True)
class AuditEntry:
    """Something that an experimenter did.

    Attributes:
        at: When, aware, UTC.
        who: Name of the experimenter, or `command line`.
        action: Past tense, such as `person_excluded`.
        about: Id of the session, or name of the study or experimenter it was about.
        detail: JSON: whatever else belongs to it; never a secret.
    """

    at: datetime
    who: str
    action: str
    about: str | None
    detail: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PersonLine:
    """One person as a monitor shows them.

    Attributes:
        session: Their session.
        condition: Of the study, where it has some.
        version: SHA-256 of the study file they met.
        ending: How the session has ended; None while it goes on.
        external: Who they are to whoever sent them, if anybody did.
        review: What experimenters have decided.
        n_events: Length of the log; 0 where nothing is known of where they stand, as for the rest.
        last_at: When something last happened, aware, UTC.
        step: See `Standing`, as for all that follow.
        n_waits: Questions that they had to wait for.
        waited_ms: How long altogether.
    """

    session: SessionRecord
    condition: str | None
    version: str
    ending: str | None
    external: ExternalPerson | None
    review: Review
    n_events: int = 0
    last_at: datetime | None = None
    step: int = 0
    n_answers: int = 0
    test_answers: str = ""
    n_repeats: int = 0
    n_repeats_agreed: int = 0
    n_checks: int = 0
    n_checks_passed: int = 0
    n_sided: int = 0
    n_first: int = 0
    response_ms: int = 0
    n_waits: int = 0
    waited_ms: int = 0
    focus_losses: int = 0
    r_hat: float | None = None
    ess: float | None = None
    mean: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Arm:
    """How many people a condition of a study has, of those who joined and count.

    Attributes:
        condition: Its name; None in a study without conditions.
        n_completed: Have completed, and aren't rejected or excluded.
        n_under_way: Have not ended, and something was heard of them lately enough.
    """

    condition: str | None
    n_completed: int
    n_under_way: int
