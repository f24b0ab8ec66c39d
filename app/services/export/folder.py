"""The folder of an export: there when it is whole, and not before."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.services.export.errors import ExportError


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Gives a folder to write into, which takes its place when everything is written, and else vanishes.

    Raises:
        ExportError: The folder isn't empty, can't be made, or what is written to it has no room.
    """
    folder = folder.absolute()
    unfinished = folder.with_name(f"{folder.name}.partial")
    try:
        if folder.exists() and any(folder.iterdir()):
            raise ExportError(f"{folder} is not empty. Name a new folder; exports never overwrite.")
        unfinished.mkdir(parents=True)
    except FileExistsError as error:
        raise ExportError(
            f"{unfinished} is there already: another export is being written, or was cut off. Remove it, or name "
            "another folder."
        ) from error
    except OSError as error:
        raise ExportError(f"Can't write to {folder}: {error.strerror}. Name another folder.") from error
    try:
        yield unfinished
        if folder.exists():
            folder.rmdir()
        unfinished.rename(folder)
    except OSError as error:
        raise ExportError(
            f"Can't write to {folder}: {error.strerror or error}. Make room or name another folder, and export again."
        ) from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
