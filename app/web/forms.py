"""The fields of a form as a browser sends it, urlencoded; files can't be sent at all."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, HTTPException, Request

from app.web.languages import N_

Fields = dict[str, list[str]]
"""Each field with all its values, in the order in which they were sent."""

_MOST_FIELDS = 1000
_KIND = "application/x-www-form-urlencoded"
_UNREADABLE = (
    N_("This page could not be read"),
    N_("Go back to the study’s page and send it again. What was saved before is still there."),
)


async def fields_of(request: Request) -> Fields:
    """Returns the form that a request brings.

    Raises:
        HTTPException: It brings something else.
    """
    # The guard has seen to its size.
    body = await request.body()
    if body and request.headers.get("content-type", "").partition(";")[0].strip().lower() != _KIND:
        raise HTTPException(415, _UNREADABLE)
    try:
        fields = parse_qs(
            body.decode("ascii"), keep_blank_values=True, errors="strict", max_num_fields=_MOST_FIELDS
        )
    except ValueError as error:
        raise HTTPException(400, _UNREADABLE) from error
    # Browsers send a line's end as two characters, whatever was typed.
    return {name: [value.replace("\r\n", "\n") for value in values] for name, values in fields.items()}


SentForm = Annotated[Fields, Depends(fields_of)]
"""The form that a request brings."""


def number_in(form: Fields, name: str) -> int | None:
    """Returns the whole number that a field of ours holds; None if it holds anything else."""
    values = form.get(name, [])
    is_number = len(values) == 1 and values[0].isascii() and values[0].isdigit() and len(values[0]) < 10
    return int(values[0]) if is_number else None
