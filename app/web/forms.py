"""What a page's form sends: its fields, as the browser wrote them; files can't be sent at all."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, HTTPException, Request

from app.web.languages import N_

Fields = dict[str, list[str]]
"""Each field of a page with all its values, in the order in which they were sent."""

_MOST_FIELDS = 1000
_KIND = "application/x-www-form-urlencoded"
_NOT_A_FORM = (
    N_("This page could not be read"),
    N_("Please go back, load the page again and send it once more."),
)


async def _fields_of(request: Request) -> Fields:
    # The guard has seen to its size.
    body = await request.body()
    if body and request.headers.get("content-type", "").partition(";")[0].strip().lower() != _KIND:
        raise HTTPException(415, _NOT_A_FORM)
    sent = body.decode("utf-8", errors="replace")
    try:
        return parse_qs(sent, keep_blank_values=True, errors="replace", max_num_fields=_MOST_FIELDS)
    except ValueError as error:
        raise HTTPException(400, _NOT_A_FORM) from error


SentForm = Annotated[Fields, Depends(_fields_of)]
"""The form in a request's body; anything else, a file above all, is refused."""


def number_in(form: Fields, name: str) -> int | None:
    """Returns the whole number that a field of ours holds; None if it holds anything else."""
    values = form.get(name, [])
    is_number = len(values) == 1 and values[0].isascii() and values[0].isdigit() and len(values[0]) < 10
    return int(values[0]) if is_number else None
