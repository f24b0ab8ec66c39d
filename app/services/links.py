"""Links to a study: what they say about the person, and the signature of those that are meant for one person alone."""

from __future__ import annotations

import base64
import hashlib
import hmac
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from urllib.parse import urlencode

from app.errors import AppError
from app.store import ExternalPerson, Store

ID_KEYS = ("PROLIFIC_PID", "participant", "participant_id", "workerId", "survey_code", "id")
"""Keys of a link that tell people apart; the first that a link has counts."""

SIGNATURE = "signature"
LANGUAGE = "lang"

_LONGEST_ID = 200
_LONGEST_KEY = 64
_MOST_OTHER_IDS = 20
_SECRET = "links"
_PERSONAL, _FAREWELL = "personal", "farewell"
_FAREWELL_HOLDS = timedelta(days=1)
_UNFILLED = ("{{", "}}")


class IncompleteLinkError(AppError):
    """A link whose id is missing, too long, not text, or still the placeholder that a service should have filled in."""


class WrongSignatureError(AppError):
    """A personal link that wasn't made here, or not for this id."""


@dataclass(frozen=True)
class Invitation:
    """What a link says of whoever opens it.

    Attributes:
        person: Who that is; None for a link that is the same for everybody.
        is_signed: Whether the link is that person's alone.
    """

    person: ExternalPerson | None
    is_signed: bool


def read_invitation(store: Store, study_name: str, query: Mapping[str, str]) -> Invitation:
    """Returns what the query of a link says.

    Args:
        store: Keeps the secret of signed links.
        study_name: The study that the link leads to.
        query: Its keys and values.

    Raises:
        IncompleteLinkError: The id, or one of the others, isn't 1 to 200 printable characters.
        WrongSignatureError: It is signed, but not by this server for this id.
    """
    key = next((key for key in ID_KEYS if key in query), None)
    if key is None:
        return Invitation(None, is_signed=False)
    # Copying by hand adds spaces.
    external_id = query[key].strip()
    others = {name: value for name, value in query.items() if name not in (key, SIGNATURE, LANGUAGE)}
    if not _is_id(external_id) or not _are_other_ids(others):
        raise IncompleteLinkError(
            f"Expected 1 to {_LONGEST_ID} printable characters for '{key}', got {external_id!r}. Mend the link."
        )
    signature = query.get(SIGNATURE)
    if signature is not None and not hmac.compare_digest(
        signature.encode(), _signature(store, _PERSONAL, study_name, external_id).encode()
    ):
        raise WrongSignatureError(f"Expected the signature of '{key}={external_id}', got another.")
    return Invitation(ExternalPerson(study_name, external_id, others), signature is not None)


def personal_link(store: Store, study_name: str, external_id: str, base_url: str) -> str:
    """Returns the link that lets one person in and, in any browser, back in.

    Args:
        store: Keeps the secret of signed links.
        study_name: The study that it leads to.
        external_id: The person, 1 to 200 printable characters.
        base_url: Where participants reach the server.

    Raises:
        IncompleteLinkError: That is no id.
    """
    if not _is_id(external_id):
        raise IncompleteLinkError(
            f"Expected 1 to {_LONGEST_ID} printable characters for an id, got {external_id!r}."
        )
    signature = _signature(store, _PERSONAL, study_name, external_id)
    query = urlencode({"id": external_id, SIGNATURE: signature})
    return f"{base_url.rstrip('/')}/join/{study_name}?{query}"


def farewell_query(store: Store, study_hash: str, language: str) -> str:
    """Returns the query of the last page for somebody who has deleted everything, so that it can be loaded again.

    It holds for a day, and says which version of a study it was and when, and nothing of the person.
    """
    at = datetime.now(UTC).isoformat(timespec="seconds")
    signature = _signature(store, _FAREWELL, study_hash, at)
    return urlencode({"version": study_hash, "at": at, LANGUAGE: language, SIGNATURE: signature})


def read_farewell(store: Store, query: Mapping[str, str]) -> str:
    """Returns the hash of the study that such a page is of.

    Raises:
        WrongSignatureError: It wasn't made here, or longer than a day ago.
    """
    study_hash, at = query.get("version", ""), query.get("at", "")
    expected = _signature(store, _FAREWELL, study_hash, at)
    if not hmac.compare_digest(query.get(SIGNATURE, "").encode(), expected.encode()):
        raise WrongSignatureError("Expected the last page of a deleted session, got a made-up one.")
    if datetime.now(UTC) > datetime.fromisoformat(at) + _FAREWELL_HOLDS:
        raise WrongSignatureError("Expected the last page of a session deleted today, got an older one.")
    return study_hash


def _signature(store: Store, *signed: str) -> str:
    """Returns 128 bits that nobody can guess who hasn't the store's secret; no line break is in what is signed."""
    digest = hmac.digest(store.secret(_SECRET), "\n".join(signed).encode(), hashlib.sha256)
    return base64.urlsafe_b64encode(digest[:16]).decode().rstrip("=")


def _is_id(text: str) -> bool:
    is_filled_in = not any(mark in text for mark in _UNFILLED)
    return 0 < len(text) <= _LONGEST_ID and text.isprintable() and is_filled_in


def _are_other_ids(others: Mapping[str, str]) -> bool:
    if len(others) > _MOST_OTHER_IDS:
        return False
    return all(
        len(key) <= _LONGEST_KEY and key.isprintable() and len(value) <= _LONGEST_ID and value.isprintable()
        for key, value in others.items()
    )
