"""How the desk's pages are made: one frame, the numbers and times in one form. They are in English."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any
from urllib.parse import urlencode

import segno
from fastapi import Request
from fastapi.responses import HTMLResponse
from fastapi.templating import Jinja2Templates
from jinja2 import Environment
from markupsafe import Markup

from app.web.pages import language_context, page_environment

NOTHING = "–"
"""Where there is no number."""


def desk_page(request: Request, template: str, context: dict[str, Any], status: int = 200) -> HTMLResponse:
    """Returns a page of the desk.

    Args:
        request: Whom it answers.
        template: Name of a template below `desk`.
        context: What it needs, besides who is logged in.
        status: HTTP's.
    """
    request.state.language = "en"
    admitted = getattr(request.state, "admitted", None)
    everywhere = {"admitted": admitted, "path": request.url.path, "now": datetime.now(UTC)}
    response = _templates.TemplateResponse(request, f"desk/{template}", everywhere | context, status)
    # Under `no-referrer`, browsers send forms with the origin "null", which is refused.
    response.headers["Referrer-Policy"] = "same-origin"
    return response


def qr_code(address: str) -> Markup:
    """Returns an address as a QR code, as inline SVG that takes the size of its place."""
    code = segno.make(address, micro=False)
    drawn = code.svg_inline(border=4, omitsize=True, light="#fff", dark="#000", svgclass="qr", lineclass=None)
    return Markup(drawn.replace("<svg ", '<svg role="img" aria-label="QR code of the link" ', 1))


def duration(length: timedelta | None) -> str:
    """Returns a length of time as people say it, to the second below ten minutes, else to the minute."""
    if length is None:
        return NOTHING
    seconds = max(0, round(length.total_seconds()))
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 600:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    if seconds < 48 * 3600:
        return (
            f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
            if seconds >= 3600
            else f"{seconds // 60} min"
        )
    return f"{seconds // 86400} days"


def moment(at: datetime | None) -> Markup | str:
    """Returns a moment; scripts turn it into the time since, and show the browser's own time zone."""
    if at is None:
        return NOTHING
    return Markup('<time datetime="{}">{}</time>').format(
        at.isoformat(timespec="seconds"), at.strftime("%Y-%m-%d %H:%M")
    )


def decimals(value: float | None, places: int = 2) -> str:
    """Returns a number with so many decimal places."""
    return NOTHING if value is None else f"{value:.{places}f}"


def percent(share: float | None) -> str:
    """Returns a share in percent."""
    return NOTHING if share is None else f"{share:.0%}"


def query_with(request: Request, **changes: str | None) -> str:
    """Returns the query of an address with some of its keys changed, or left out where they are None."""
    kept = {name: value for name, value in request.query_params.items() if name not in changes}
    new = {name: value for name, value in changes.items() if value is not None}
    return f"?{urlencode(kept | new)}"


def _environment() -> Environment:
    environment = page_environment()
    environment.filters |= {
        "duration": duration,
        "moment": moment,
        "decimals": decimals,
        "share": percent,
        "qr": qr_code,
    }
    environment.globals["query_with"] = query_with
    environment.trim_blocks = environment.lstrip_blocks = True
    return environment


_templates = Jinja2Templates(env=_environment(), context_processors=[language_context])
