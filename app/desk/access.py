"""Who may call what: one table of every route, read by the code that enforces it and by the documentation."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from fastapi import Request

from app.store import Role


class Caller(StrEnum):
    """Who a route is for; a role's routes are for the roles above it too."""

    ANYONE = "anyone"
    SESSION = "whoever has the session’s secret link"
    VIEWER = "viewers"
    ASSISTANT = "assistants"
    OWNER = "owners"


ROLES: Mapping[Caller, Role] = {
    Caller.VIEWER: Role.VIEWER,
    Caller.ASSISTANT: Role.ASSISTANT,
    Caller.OWNER: Role.OWNER,
}
"""The least role of an experimenter who may call a route; the other callers need none."""

CALLERS: Mapping[str, Caller] = {
    "GET /healthz": Caller.ANYONE,
    "GET /static/{path}": Caller.ANYONE,
    # The way in.
    "GET /join/{name}": Caller.ANYONE,
    "HEAD /join/{name}": Caller.ANYONE,
    "POST /join/{name}": Caller.ANYONE,
    "GET /join/{name}/resume": Caller.ANYONE,
    "POST /join/{name}/resume": Caller.ANYONE,
    "GET /join/{name}/deleted": Caller.ANYONE,
    # A participant's own session.
    "GET /s/{token}/": Caller.SESSION,
    "POST /s/{token}/": Caller.SESSION,
    "GET /s/{token}/screens": Caller.SESSION,
    "GET /s/{token}/step": Caller.SESSION,
    "POST /s/{token}/step": Caller.SESSION,
    "POST /s/{token}/language": Caller.SESSION,
    "POST /s/{token}/answer": Caller.SESSION,
    "POST /s/{token}/take-back": Caller.SESSION,
    "POST /s/{token}/break": Caller.SESSION,
    "GET /s/{token}/device": Caller.SESSION,
    "GET /s/{token}/leave": Caller.SESSION,
    "POST /s/{token}/stop": Caller.SESSION,
    "POST /s/{token}/again": Caller.SESSION,
    "GET /s/{token}/stage": Caller.SESSION,
    "POST /s/{token}/stage": Caller.SESSION,
    "GET /s/{token}/stage/": Caller.SESSION,
    "WEBSOCKET /s/{token}/stage": Caller.SESSION,
    # The desk's pages.
    "GET /desk/setup": Caller.ANYONE,
    "POST /desk/setup": Caller.ANYONE,
    "GET /desk/login": Caller.ANYONE,
    "POST /desk/login": Caller.ANYONE,
    "POST /desk/logout": Caller.ANYONE,
    "GET /desk/": Caller.VIEWER,
    "GET /desk/studies/{name}": Caller.VIEWER,
    "GET /desk/studies/{name}/links": Caller.ASSISTANT,
    "POST /desk/studies/{name}/links": Caller.ASSISTANT,
    "GET /desk/studies/{name}/export": Caller.ASSISTANT,
    "GET /desk/studies/{name}/export.zip": Caller.ASSISTANT,
    "GET /desk/studies/{name}/reports": Caller.ASSISTANT,
    "POST /desk/studies/{name}/reports/{kind}": Caller.ASSISTANT,
    "GET /desk/studies/{name}/reports/{kind}/file": Caller.ASSISTANT,
    "GET /desk/people/{session_id}": Caller.VIEWER,
    "POST /desk/people/{session_id}/review": Caller.ASSISTANT,
    "POST /desk/people/{session_id}/reopen": Caller.ASSISTANT,
    "POST /desk/people/{session_id}/delete": Caller.OWNER,
    "GET /desk/accounts": Caller.OWNER,
    "POST /desk/accounts": Caller.OWNER,
    "POST /desk/accounts/role": Caller.OWNER,
    "POST /desk/accounts/reset": Caller.OWNER,
    "POST /desk/accounts/remove": Caller.OWNER,
    "GET /desk/me": Caller.VIEWER,
    "POST /desk/me": Caller.VIEWER,
    "GET /desk/tokens": Caller.VIEWER,
    "POST /desk/tokens": Caller.VIEWER,
    "POST /desk/tokens/{token_id}/revoke": Caller.VIEWER,
    "GET /desk/audit": Caller.OWNER,
    "GET /desk/backup": Caller.OWNER,
    # The JSON API.
    "GET /api/v1/openapi.json": Caller.ANYONE,
    "GET /api/v1/me": Caller.VIEWER,
    "GET /api/v1/studies": Caller.VIEWER,
    "GET /api/v1/studies/{name}": Caller.VIEWER,
    "GET /api/v1/studies/{name}/people": Caller.VIEWER,
    "GET /api/v1/studies/{name}/links": Caller.ASSISTANT,
    "POST /api/v1/studies/{name}/links": Caller.ASSISTANT,
    "GET /api/v1/studies/{name}/export": Caller.ASSISTANT,
    "GET /api/v1/studies/{name}/reports/{kind}": Caller.ASSISTANT,
    "POST /api/v1/studies/{name}/reports/{kind}": Caller.ASSISTANT,
    "GET /api/v1/studies/{name}/reports/{kind}/file": Caller.ASSISTANT,
    "GET /api/v1/people/{session_id}": Caller.VIEWER,
    "PUT /api/v1/people/{session_id}/review": Caller.ASSISTANT,
    "POST /api/v1/people/{session_id}/reopen": Caller.ASSISTANT,
    "DELETE /api/v1/people/{session_id}": Caller.OWNER,
    "GET /api/v1/accounts": Caller.OWNER,
    "POST /api/v1/accounts": Caller.OWNER,
    "PATCH /api/v1/accounts/{name}": Caller.OWNER,
    "DELETE /api/v1/accounts/{name}": Caller.OWNER,
    "GET /api/v1/tokens": Caller.VIEWER,
    "POST /api/v1/tokens": Caller.VIEWER,
    "DELETE /api/v1/tokens/{token_id}": Caller.VIEWER,
    "GET /api/v1/audit": Caller.OWNER,
    "GET /api/v1/backup": Caller.OWNER,
}
"""Every route, by its method and path."""


def caller_of(request: Request) -> Caller:
    """Returns who the route of a request is for; a route that nobody has thought of is for owners."""
    path = f"{request.scope.get('root_path', '')}{request.scope['route'].path}"
    return CALLERS.get(f"{request.method} {path}", Caller.OWNER)
