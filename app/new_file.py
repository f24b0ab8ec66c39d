"""Files that hold results: always new ones."""

from __future__ import annotations

from pathlib import Path
from typing import TextIO

from app.errors import AppError


class NewFileError(AppError):
    """A file that can't be made."""


def open_new(path: Path) -> TextIO:
    """Opens a file that must not exist, for text in UTF-8 whose lines end as they are written.

    Raises:
        NewFileError: It exists, or can't be made.
    """
    try:
        return path.open("x", encoding="utf-8", newline="")
    except OSError as error:
        raise NewFileError(f"Can't write {path}: {error.strerror}. Name a new file.") from error
