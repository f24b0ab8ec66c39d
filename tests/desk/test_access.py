"""Who may call what: the table holds every route, and every route keeps to the table."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fastapi import FastAPI
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute

from app.desk.access import CALLERS, ROLES, Caller
from app.settings import ROOT
from app.store import Role
from app.web.site import create_site
from tests.desk.laboratory import Laboratory


def routes_of(application: FastAPI, prefix: str = "") -> Iterator[str]:
    """Gives every route of an application by method and path, those of its routers and mounts among them."""
    for route in application.routes:
        yield from _of_route(route, prefix)


def _of_route(route: BaseRoute, prefix: str) -> Iterator[str]:
    included = getattr(route, "original_router", None)
    if included is not None:
        for inner in included.routes:
            yield from _of_route(inner, prefix)
    elif isinstance(route, Mount):
        inner_routes = getattr(route.app, "routes", None)
        if inner_routes is None:
            yield f"GET {prefix}{route.path}/{{path}}"
        else:
            for inner in inner_routes:
                yield from _of_route(inner, prefix + route.path)
    elif isinstance(route, WebSocketRoute):
        yield f"WEBSOCKET {prefix}{route.path}"
    else:
        assert isinstance(route, Route), f"a kind of route that this doesn't know: {route}"
        # GET brings HEAD along with it, which gives no more; where it stands alone it is a route of its own.
        methods = set(route.methods or ()) - ({"HEAD"} if type(route) is Route else set())
        yield from (f"{method} {prefix}{route.path}" for method in sorted(methods))


def test_every_route_of_the_site_is_in_the_table_and_nothing_else_is(lab: Laboratory) -> None:
    assert sorted(routes_of(create_site(lab.parts))) == sorted(CALLERS)


def test_the_documentation_lists_every_route_with_who_may_call_it() -> None:
    rows = [f"| `{route}` | {caller.value} |" for route, caller in CALLERS.items()]
    text = (ROOT / "docs" / "routes.md").read_text(encoding="utf-8")
    assert [line for line in text.splitlines() if line.startswith("| `")] == rows


NOT_THERE = "0" * 32
FILLED_IN = {
    "{name}": "quickstart",
    "{session_id}": NOT_THERE,
    "{token_id}": "0" * 16,
    "{token}": "a" * 22,
    "{path}": "css/desk.css",
}
GUARDED = {route: ROLES[caller] for route, caller in CALLERS.items() if caller in ROLES}


def call(route: str) -> tuple[str, str]:
    method, path = route.split(" ")
    for gap, value in FILLED_IN.items():
        path = path.replace(gap, value)
    return method, path


@pytest.mark.parametrize("role", [None, *Role], ids=lambda role: role or "nobody")
def test_every_route_of_the_desk_is_open_to_its_roles_and_shut_to_the_others(
    lab: Laboratory, role: Role | None
) -> None:
    with lab.nobody() if role is None else lab.browser(role) as visitor:
        for route, needed in GUARDED.items():
            method, path = call(route)
            answer = visitor.request(method, path, content=b"" if method == "GET" else b"{}")
            is_let_in = role is not None and role.may_act_as(needed)
            if role is None and path.startswith("/desk") and method == "GET":
                assert answer.status_code == 303, route
                assert answer.headers["location"].startswith("/desk/login"), route
            elif role is None:
                assert answer.status_code == 401, route
            elif is_let_in:
                assert answer.status_code not in (401, 403, 500), route
            else:
                assert answer.status_code == 403, route


@pytest.mark.parametrize("role", list(Role))
def test_a_token_opens_the_api_alone_and_no_more_than_its_role(lab: Laboratory, role: Role) -> None:
    with lab.program(role) as program:
        for route, needed in GUARDED.items():
            method, path = call(route)
            if path.startswith("/api") and path != "/api/v1/tokens":
                status = program.request(method, path, content=b"{}").status_code
                assert (status == 403) == (not role.may_act_as(needed)), route
                assert status != 401, route


def test_what_a_session_has_is_shown_to_nobody_without_its_secret(lab: Laboratory) -> None:
    with lab.browser(Role.OWNER) as visitor:
        for route, caller in CALLERS.items():
            method, path = call(route)
            if caller is Caller.SESSION and method != "WEBSOCKET":
                # Some look at the form of what was sent before they look whose it is.
                assert visitor.request(method, path, content=b"").status_code in (404, 422), route


@pytest.mark.parametrize("header", ["Bearer wrong", "Basic dmVyYTp2ZXJh", "Bearer"])
def test_a_header_that_lets_nobody_in_is_not_made_up_for_by_a_cookie(lab: Laboratory, header: str) -> None:
    with lab.browser(Role.OWNER) as visitor:
        answer = visitor.get("/api/v1/me", headers={"Authorization": header})
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"] == "Bearer"
    assert answer.json()["error"]["code"] == "not-logged-in"
