"""What can be wrong with an export."""

from __future__ import annotations

from app.errors import AppError


class ExportError(AppError):
    """An export that can't be written or read, or would hold nothing."""


class ExportDifferenceError(ExportError):
    """An export that isn't as it was written; the message names the first thing that differs."""
