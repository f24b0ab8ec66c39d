"""Whether what is derived again is what was stored, to the last bit."""

from __future__ import annotations

from study_core import session_codec
from study_core.events import Event, QueryPrepared

# What says when, where and by whom something was computed, not what it is.
_CIRCUMSTANCES = ("code_version", "compute_ms", "machine")

# Where a trajectory stands is seen in the clips, too.
_SIDES = ("first_shown", "clips")


def first_difference(stored: Event, derived: Event) -> str | None:
    """Returns the name and both values of the first number or text that differs, or None.

    The cost of computing it, the machine and the version of the program are circumstances, not part of it. A query
    that was stored before sides were drawn is compared without its sides.
    """
    has_sides = not isinstance(stored, QueryPrepared) or stored.first_shown is not None
    left_out = _CIRCUMSTANCES if has_sides else (*_CIRCUMSTANCES, *_SIDES)
    return _difference("", _content(stored, left_out), _content(derived, left_out))


def _content(event: Event, left_out: tuple[str, ...]) -> session_codec.Json:
    return {key: value for key, value in session_codec.to_json(event).items() if key not in left_out}


def _difference(where: str, stored: object, derived: object) -> str | None:
    if isinstance(stored, dict) and isinstance(derived, dict):
        keys = sorted(stored.keys() | derived.keys())
        parts = [(f"{where}.{key}".lstrip("."), stored.get(key), derived.get(key)) for key in keys]
    elif isinstance(stored, list) and isinstance(derived, list) and len(stored) == len(derived):
        parts = [
            (f"{where}[{i}]", old, new) for i, (old, new) in enumerate(zip(stored, derived, strict=True))
        ]
    else:
        return None if stored == derived else f"{where}: stored {stored!r}, derived {derived!r}"
    return next((found for part in parts if (found := _difference(*part)) is not None), None)
