"""What experimenters decide about people: whether they count, whether they go on, whether anything of them is kept."""

from __future__ import annotations

from app.errors import AppError
from app.services import leaving, path
from app.services.runtime import Runtime
from app.store import Deletion, Review, Verdict
from study_core.session import can_be_reopened

LONGEST_REASON, LONGEST_NOTE = 500, 5000
"""Characters."""

_VERDICT_GIVEN = {Verdict.REJECTED: "person_rejected", Verdict.EXCLUDED: "person_excluded"}


class ImpossibleReviewError(AppError):
    """A verdict without a reason, or more text than is kept."""


class NotReopenedError(AppError):
    """A session that goes on, or whose person has gone to the end of the path."""


def review(runtime: Runtime, who: str, session_id: str, wanted: Review) -> Review:
    """Changes what is decided about a person.

    Args:
        runtime: The services' resources.
        who: Name of the experimenter.
        session_id: Whose.
        wanted: What is to be; its revision is the one that the experimenter has seen.

    Returns:
        What is decided now.

    Raises:
        ImpossibleReviewError: A verdict has no reason, or there is too much text, or unprintable.
        ReviewChangedError: Somebody else has changed it since.
        SessionDeletedError: The person was deleted.
    """
    _check(wanted)
    before = runtime.store.desk.review(session_id)
    changed = runtime.store.desk.put_review(session_id, wanted, who)
    record = runtime.store.desk.record
    # Reasons and notes may tell of the person, and the audit outlives them: it holds neither.
    if (before.verdict, before.reason) != (changed.verdict, changed.reason):
        action = "verdict_taken_back" if changed.verdict is None else _VERDICT_GIVEN[changed.verdict]
        record(who, action, session_id)
    if before.note != changed.note:
        record(who, "note_changed", session_id)
    return changed


def can_reopen(runtime: Runtime, session_id: str) -> bool:
    """Returns whether a person's session has ended in a way that they can come back from."""
    return can_be_reopened(runtime.live(session_id).state)


def reopen(runtime: Runtime, who: str, session_id: str) -> None:
    """Lets somebody go on whose session has ended before its path does.

    Raises:
        NotReopenedError: It can't be.
        SessionDeletedError: The person was deleted.
    """
    if not can_reopen(runtime, session_id):
        raise NotReopenedError(
            "Only a session that has ended before its time can be reopened; this one goes on, or is complete."
        )
    path.reopen(runtime, session_id)
    runtime.store.desk.record(who, "person_reopened", session_id)


def delete(runtime: Runtime, who: str, session_id: str) -> Deletion:
    """Deletes a person with everything that was learned from them.

    Raises:
        SessionDeletedError: They were deleted before.
    """
    deleted = leaving.delete(runtime, session_id)
    runtime.store.desk.record(who, "person_deleted", session_id, {"answers": deleted.n_answers})
    return deleted


def _check(wanted: Review) -> None:
    if wanted.verdict is not None and not wanted.reason.strip():
        raise ImpossibleReviewError("Expected a reason. Say in a few words why this person doesn’t count.")
    for text, longest, what in (
        (wanted.reason, LONGEST_REASON, "reason"),
        (wanted.note, LONGEST_NOTE, "note"),
    ):
        if len(text) > longest:
            raise ImpossibleReviewError(
                f"Expected a {what} of at most {longest} characters, got {len(text)}."
            )
        if any(not (letter.isprintable() or letter in "\n\t") for letter in text):
            raise ImpossibleReviewError(
                f"Expected a {what} of letters and line breaks, got unprintable ones."
            )
