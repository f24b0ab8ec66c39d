"""The links that lead to a study, and what a sheet of them shows."""

from __future__ import annotations

from collections.abc import Iterable

from app.errors import AppError
from app.services.links import personal_link
from app.store import Store

MOST_LINKS = 1000
"""At a time."""

_PROLIFIC = "PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID={{%STUDY_ID%}}&SESSION_ID={{%SESSION_ID%}}"


class TooManyLinksError(AppError):
    """More links than fit on one page."""


def open_link(study_name: str, base_url: str) -> str:
    """Returns the link that is the same for everybody."""
    return f"{base_url}/join/{study_name}"


def prolific_link(study_name: str, base_url: str) -> str:
    """Returns the link for Prolific, which fills in who comes."""
    return f"{open_link(study_name, base_url)}?{_PROLIFIC}"


def personal_links(store: Store, study_name: str, ids: Iterable[str], base_url: str) -> dict[str, str]:
    """Returns each person's own link, by their id, in the order in which they were given.

    Args:
        store: Keeps the secret that signs them.
        study_name: Where they lead.
        ids: Whom they are for; empty ones and those that come twice are left out.
        base_url: Where participants reach the server.

    Raises:
        IncompleteLinkError: One is no id.
        TooManyLinksError: There are too many.
    """
    wanted = dict.fromkeys(line.strip() for line in ids if line.strip())
    if len(wanted) > MOST_LINKS:
        raise TooManyLinksError(
            f"Expected at most {MOST_LINKS} ids, got {len(wanted)}. Make them in several goes."
        )
    return {each: personal_link(store, study_name, each, base_url) for each in wanted}
