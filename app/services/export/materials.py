"""What people were shown, and what was learned from them: studies, texts, clips and models, as files of their own."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path

from app.store import EventRecord, ModelRecord
from study_core import session_codec
from study_core.comparison import Choice, Query
from study_core.domain import Domain
from study_core.events import QueryPrepared
from study_core.section import words_in
from study_core.study import Study

ClipBuilder = Callable[[Domain, Query, Choice], Iterable[bytes]]
"""Builds the clips that show a query, given which trajectory stands first: one for each picture layout."""


def write_study(folder: Path, study: Study) -> None:
    """Writes a study's file, under its hash, and each of its texts in each language."""
    _write(folder / "studies" / f"{study.hash}.toml", study.text.encode())
    for name in study.file.text:
        for language in study.languages:
            words = words_in(study.file.text[name], language)
            _write(folder / "texts" / study.hash / f"{name}.{language}.md", words.encode())


def write_model(folder: Path, model: ModelRecord) -> None:
    """Writes a model's bytes under their SHA-256."""
    # Models are JSON or safetensors, which begins with eight bytes of length.
    suffix = "json" if model.content.startswith(b"{") else "safetensors"
    _write_once(folder / "networks", model.content, suffix)


def write_clips(folder: Path, study: Study, events: Iterable[EventRecord], build: ClipBuilder) -> None:
    """Writes the clips of every query in a log, each under its SHA-256, which the log has as well."""
    for event in events:
        if event.kind == session_codec.KINDS[QueryPrepared]:
            prepared = session_codec.from_json(event.kind, event.payload)
            assert isinstance(prepared, QueryPrepared), "that kind is read as no other event"
            for clip in build(study.domain, prepared.proposed.query, prepared.side_shown_first):
                _write_once(folder / "clips", clip, "glb")


def _write_once(folder: Path, content: bytes, suffix: str) -> None:
    path = folder / f"{hashlib.sha256(content).hexdigest()}.{suffix}"
    if not path.exists():
        _write(path, content)


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
