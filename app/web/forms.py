"""What a page's form sends: its fields, as the browser wrote them."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, HTTPException, Request

from app.web.languages import N_

Form = dict[str, list[str]]
"""Each field of a page with all its values."""

_MOST_FIELDS = 1000
_NOT_A_FORM = (
    N_("This page could not be read"),
    N_("Please go back, load the page again and send it once more."),
)


async def _posted_form(request: Request) -> Form:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/x-www-form-urlencoded":
        raise HTTPException(415, _NOT_A_FORM)
    sent = (await request.body()).decode("utf-8", errors="replace")
    try:
        return parse_qs(sent, keep_blank_values=True, errors="replace", max_num_fields=_MOST_FIELDS)
    except ValueError as error:
        raise HTTPException(400, _NOT_A_FORM) from error


PostedForm = Annotated[Form, Depends(_posted_form)]
"""The form in a request's body; anything else, a file above all, is refused."""
