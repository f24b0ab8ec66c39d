"""What can be wrong with a session that is derived again."""

from __future__ import annotations

from app.errors import AppError


class ReplayDifferenceError(AppError):
    """Something that was stored isn't what it comes to; the message names the person, the query and the number."""


class OtherVersionError(AppError):
    """Something was computed by other methods than those installed; the message names the release to install."""
