"""People under other names: what an export says of somebody who is not to be recognised by it.

What can't be known is whether somebody wrote who they are into a free text. Of such texts only the ids that the person
is known by here, and every session's id, are taken out.
"""

from __future__ import annotations

import csv
import hashlib
import hmac
import os
import re
import secrets
from base64 import b32encode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from app.services.export.errors import ExportError
from app.store import EventRecord, MeasureRecord, ModelRecord, PersonRecord

WriteKey = Callable[[str, str, str | None], None]
"""Keeps a pseudonym, the session's id that it stands for, and the person's external id."""

# A session's id, but not a part of a longer digest.
_SESSION_ID = re.compile(r"(?<![0-9a-f])[0-9a-f]{32}(?![0-9a-f])")
_TAKEN_OUT = "[id]"
# A shorter id, such as `a`, is also a word like any other.
_FEWEST_LETTERS = 4
_BEGINNING = datetime(1970, 1, 1, tzinfo=UTC)


class Pseudonyms:
    """The pseudonyms of one export: keyed by a secret that nobody keeps."""

    def __init__(self, write_key: WriteKey, keeps_times: bool) -> None:
        """Draws the secret.

        Args:
            write_key: Keeps the key.
            keeps_times: Whether times stay; otherwise a person's session was created at the beginning of 1970.
        """
        self._secret = secrets.token_bytes(32)
        self._write_key = write_key
        self._keeps_times = keeps_times

    def of(self, person: PersonRecord) -> PersonRecord:
        """Returns a person under their pseudonym, without the ids that others know them by."""
        session, external = person.session, person.external
        others = () if external is None else (external.external_id, *external.other_ids.values())
        code = self._code(session.id)
        self._write_key(code, session.id, None if external is None else external.external_id)
        shift = timedelta(0) if self._keeps_times else _BEGINNING - session.created_at
        return replace(
            person,
            session=replace(session, id=code, created_at=session.created_at + shift),
            external=None,
            review=replace(person.review, reason=self._told(person.review.reason, others)),
            events=tuple(self._event(event, others, shift) for event in person.events),
            measures=tuple(self._measure(each, others, shift) for each in person.measures),
            models=tuple(self.of_model(model) for model in person.models),
        )

    def of_model(self, model: ModelRecord) -> ModelRecord:
        """Returns a model that names the people it learned from by their pseudonyms."""
        return replace(model, lineage=self._told(model.lineage, ()))

    def _event(self, event: EventRecord, others: tuple[str, ...], shift: timedelta) -> EventRecord:
        # Only what somebody wrote themselves can hold an external id.
        known = others if event.kind == "step_taken" else ()
        return replace(event, payload=self._told(event.payload, known), at=event.at + shift)

    def _measure(self, measured: MeasureRecord, others: tuple[str, ...], shift: timedelta) -> MeasureRecord:
        return replace(measured, measures=self._told(measured.measures, others), at=measured.at + shift)

    def _told(self, value: Any, others: tuple[str, ...]) -> Any:
        """Returns a JSON value whose texts name nobody by an id that is known here."""
        if isinstance(value, dict):
            return {self._told(key, others): self._told(each, others) for key, each in value.items()}
        if isinstance(value, list):
            return [self._told(each, others) for each in value]
        if not isinstance(value, str):
            return value
        for other in others:
            if len(other) >= _FEWEST_LETTERS:
                value = re.sub(re.escape(other), _TAKEN_OUT, value, flags=re.IGNORECASE)
        return _SESSION_ID.sub(lambda found: self._code(found[0]), value)

    def _code(self, session_id: str) -> str:
        digest = hmac.new(self._secret, session_id.encode(), hashlib.sha256).digest()
        return "P" + b32encode(digest)[:12].decode()


@contextmanager
def new_key_file(path: Path, folder: Path) -> Iterator[WriteKey]:
    """Opens a new file for the key, which only its owner can read; gives what writes to it.

    It is removed again if the export fails.

    Raises:
        ExportError: It exists, can't be made, or would be exported itself.
    """
    if path.absolute().is_relative_to(folder.absolute()):
        raise ExportError(f"{path} would be a part of the export. Keep the key to the pseudonyms elsewhere.")
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise ExportError(f"Can't write the key {path}: {error.strerror}. Name a new file.") from error
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("pseudonym", "person_id", "external_id"))
            yield lambda *row: writer.writerow(row)
    except BaseException:
        path.unlink()
        raise
