"""Errors of the science core: misuse is an exception that names the remedy; numerical failure is a status value."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


class StudyCoreError(Exception):
    """Root of every error that `study_core` raises on purpose."""


class UnknownNameError(StudyCoreError):
    """A name that nothing is registered under.

    Attributes:
        what: What kind of thing it should have named.
    """

    def __init__(self, what: str, name: str, known: Iterable[str]) -> None:
        self.what = what
        known = sorted(known)
        close = difflib.get_close_matches(name, known, n=1)
        hint = f"Did you mean '{close[0]}'?" if close else f"Known: {', '.join(known)}."
        super().__init__(f"No {what} named '{name}'. {hint}")


class DomainError(StudyCoreError):
    """A domain plug-in breaks its contract."""


class NotATrajectoryError(StudyCoreError):
    """States that no controls of the domain lead to."""


class BankError(StudyCoreError):
    """A bank of optimised trajectories that can't be built, or is another domain's."""


class StudyError(StudyCoreError):
    """A study file that can't be used; the message names the key and what was expected.

    Attributes:
        problems: All that is wrong, where that is known; the message says the first.
    """

    def __init__(self, message: str, problems: tuple[StudyProblem, ...] = ()) -> None:
        super().__init__(message)
        self.problems = problems


@dataclass(frozen=True)
class StudyProblem:
    """One thing that is wrong with a study file.

    Attributes:
        location: Where in the file: keys, and places in lists from 0.
        message: What was expected there, and what came.
    """

    location: tuple[str | int, ...]
    message: str


class SessionError(StudyCoreError):
    """An event that the session's log does not allow."""


class AnswerNotCurrentError(SessionError):
    """An answer for a query that isn't the one being asked."""


class PublishedDataError(StudyCoreError):
    """A file of the published study that can't be read."""


class ScriptError(StudyCoreError):
    """A scripted session with too few, too many or wrong answers."""


class TooFewAnswersError(StudyCoreError):
    """Fewer answers than a predictor can learn from."""


class NetworkError(StudyCoreError):
    """A feature network that can't be configured or trained."""


class CheckpointError(StudyCoreError):
    """A stored network that can't be read."""
