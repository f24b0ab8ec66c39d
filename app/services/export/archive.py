"""An export as one zip file that is sent while it is packed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self
from zipfile import ZIP_DEFLATED

from zipstream import ZipStream

from app.services.export.materials import ClipBuilder
from app.services.export.options import ExportOptions
from app.services.export.writing import export
from app.store import Store

_FAST = 1
"""Level of compression: tables shrink by much at once, and somebody waits."""


class Archive:
    """A zip file, as bytes to iterate over once; nothing of it is ever held in memory.

    One pass over the people writes all tables, so the export is first written to a temporary folder. It is removed
    after the last byte, when the iteration is given up, or by `close`.

    Attributes:
        n_people: How many people are in it.
    """

    def __init__(
        self, store: Store, options: ExportOptions, name: str, build_clips: ClipBuilder | None = None
    ) -> None:
        """Writes the export.

        Args:
            store: Where the answers are.
            options: What is exported; a key to pseudonyms goes to its own file, never into the archive.
            name: Of the folder in the zip file.
            build_clips: Builds the clips that people saw, if they are wanted.

        Raises:
            ExportError: There is nobody to export, or no room.
        """
        self._name = name
        self._folder = TemporaryDirectory(prefix="prefstudy-export-")
        try:
            self.n_people = export(store, self._path, options, build_clips=build_clips)
        except BaseException:
            self.close()
            raise

    def __iter__(self) -> Iterator[bytes]:
        """Gives the zip file, piece by piece."""
        try:
            packed = ZipStream(compress_type=ZIP_DEFLATED, compress_level=_FAST)
            packed.add_path(self._path, arcname=self._name)
            yield from packed
        finally:
            self.close()

    def __enter__(self) -> Self:
        """Gives the archive itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Removes the temporary folder."""
        self.close()

    def close(self) -> None:
        """Removes the temporary folder; doing it twice changes nothing."""
        self._folder.cleanup()

    @property
    def _path(self) -> Path:
        return Path(self._folder.name) / "export"
