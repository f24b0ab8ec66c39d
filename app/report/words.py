"""What the report says beside numbers: in a file of its own, to be read, corrected and translated."""

from __future__ import annotations

import tomllib
from typing import Any

from app.settings import STATIC


def read_words() -> dict[str, Any]:
    """Returns titles, captions and paragraphs by what they are about; `{names}` in them are filled in later."""
    return tomllib.loads((STATIC / "report" / "words.toml").read_text(encoding="utf-8"))
