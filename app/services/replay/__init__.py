"""Deriving sessions again, and comparing them with what was stored: from a script, or from an export alone."""

from app.services.replay.derivation import derive
from app.services.replay.errors import OtherVersionError, ReplayDifferenceError
from app.services.replay.export import PersonReplayed, Reproduction, Survey, people_of, survey
from app.services.replay.person import ExportedPerson
from app.services.replay.script import Script, read_script, replay_script
from app.services.replay.steps import verify_steps

__all__ = [
    "ExportedPerson",
    "OtherVersionError",
    "PersonReplayed",
    "ReplayDifferenceError",
    "Reproduction",
    "Script",
    "Survey",
    "derive",
    "people_of",
    "read_script",
    "replay_script",
    "survey",
    "verify_steps",
]
