"""Whether what is derived again is what was stored, to the last bit."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from study_core import session_codec
from study_core.events import Event, FeatureLearned, QueryPrepared
from study_core.networks.model import Networks
from study_core.online.feature import LearnedFeature

# What says when, where and by whom something was computed, not what it is.
_CIRCUMSTANCES = ("code_version", "compute_ms", "machine")

# Where a trajectory stands is seen in the clips, too.
_SIDES = ("first_shown", "clips")


@dataclass(frozen=True)
class Difference:
    """A number or a text that isn't what was stored.

    Attributes:
        quantity: Its name, such as `query.controls_b[7]`.
        stored: Its value.
        derived: What it came to.
    """

    quantity: str
    stored: Any
    derived: Any

    def __str__(self) -> str:
        return f"{self.quantity}: stored {self.stored!r}, derived {self.derived!r}"


def first_difference(stored: Event, derived: Event) -> Difference | None:
    """Returns the first number or text that differs, or None.

    The cost of computing it, the machine and the version of the program are circumstances, not part of it. A query
    that was stored before sides were drawn is compared without its sides.
    """
    has_sides = not isinstance(stored, QueryPrepared) or stored.first_shown is not None
    left_out = _CIRCUMSTANCES if has_sides else (*_CIRCUMSTANCES, *_SIDES)
    return difference_of(_content(stored, left_out), _content(derived, left_out))


def _content(event: Event, left_out: tuple[str, ...]) -> session_codec.Json:
    content = {key: value for key, value in session_codec.to_json(event).items() if key not in left_out}
    if isinstance(event, FeatureLearned) and event.feature is not None:
        content["feature"] = _feature_content(event.feature)
    return content


def _feature_content(feature: LearnedFeature) -> session_codec.Json:
    """Returns a feature number by number; the version of the program that learned it is a circumstance as well."""
    checkpoint = feature.checkpoint
    lineage = asdict(checkpoint.lineage)
    networks = {each.name: getattr(checkpoint.networks, each.name).tolist() for each in fields(Networks)}
    return {
        "n_learned_from": feature.n_learned_from,
        "networks": networks,
        "config": checkpoint.config.to_json(),
        "lineage": lineage | {"versions": list(lineage["versions"][1:])},
        "drives": feature.drives.tolist(),
        "drive_weights": feature.drive_weights.tolist(),
    }


def difference_of(stored: object, derived: object, where: str = "") -> Difference | None:
    """Returns the first of two JSON values' entries that differs, or None.

    Args:
        stored: One.
        derived: The other.
        where: What both are called.
    """
    if isinstance(stored, dict) and isinstance(derived, dict):
        keys = sorted(stored.keys() | derived.keys())
        parts = [(f"{where}.{key}".lstrip("."), stored.get(key), derived.get(key)) for key in keys]
    elif isinstance(stored, list) and isinstance(derived, list) and len(stored) == len(derived):
        parts = [
            (f"{where}[{i}]", old, new) for i, (old, new) in enumerate(zip(stored, derived, strict=True))
        ]
    else:
        return None if stored == derived else Difference(where, stored, derived)
    found = (difference_of(old, new, name) for name, old, new in parts)
    return next((each for each in found if each is not None), None)
