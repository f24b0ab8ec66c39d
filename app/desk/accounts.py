"""The desk's pages of accounts, programs' tokens, and of what experimenters did."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.desk.admission import Here
from app.desk.login import only
from app.desk.parts import DeskParts
from app.desk.tokens import make_api_token, revoke_api_token
from app.desk.view import desk_page
from app.errors import AppError
from app.services.desk_accounts import ImpossibleNameError
from app.services.passwords import SHORTEST, WeakPasswordError
from app.store import ExperimenterKnownError, Role
from app.web.forms import Fields, SentForm, number_in

_AUDIT_PAGE = 100


class ImpossibleRoleError(AppError):
    """A role that there isn't."""


def account_routes(parts: DeskParts) -> APIRouter:
    """Returns the routes of accounts, tokens and audit."""
    router = APIRouter()
    accounts, kept = parts.accounts, parts.runtime.store.desk

    def accounts_page(request: Request, status: int = 200, **told: str) -> Response:
        context = {
            "experimenters": kept.experimenters(),
            "roles": list(Role),
            "shortest": SHORTEST,
            "told": told,
        }
        return desk_page(request, "accounts.html", context, status)

    @router.get("/accounts")
    def list_accounts(request: Request) -> Response:
        return accounts_page(request)

    @router.post("/accounts")
    def add_account(request: Request, here: Here, form: SentForm) -> Response:
        name, role = only(form, "name"), only(form, "role")
        try:
            accounts.add(here.name, name, only(form, "password"), _role(form))
        except (ExperimenterKnownError, ImpossibleNameError, WeakPasswordError) as error:
            return accounts_page(request, 422, problem=str(error), name=name, role=role)
        return _to("/desk/accounts")

    @router.post("/accounts/role")
    def change_role(here: Here, form: SentForm) -> Response:
        accounts.change_role(here.name, only(form, "name"), _role(form))
        return _to("/desk/accounts")

    @router.post("/accounts/reset")
    def reset_password(request: Request, here: Here, form: SentForm) -> Response:
        name = only(form, "name")
        return accounts_page(request, reset=name, password=accounts.reset_password(here.name, name))

    @router.post("/accounts/remove")
    def remove_account(here: Here, form: SentForm) -> Response:
        accounts.remove(here.name, only(form, "name"))
        return _to("/desk/accounts")

    def tokens_page(request: Request, here: Here, status: int = 200, **told: str) -> Response:
        roles = [role for role in Role if here.experimenter.role.may_act_as(role)]
        tokens = kept.api_tokens(None if here.is_owner else here.name)
        return desk_page(request, "tokens.html", {"tokens": tokens, "roles": roles, "told": told}, status)

    @router.get("/tokens")
    def list_tokens(request: Request, here: Here) -> Response:
        return tokens_page(request, here)

    @router.post("/tokens")
    def make_token(request: Request, here: Here, form: SentForm) -> Response:
        label = only(form, "label")
        try:
            _, secret = make_api_token(accounts, here, label, _role(form))
        except ImpossibleNameError as error:
            return tokens_page(request, here, 422, problem=str(error), label=label)
        return tokens_page(request, here, secret=secret)

    @router.post("/tokens/{token_id}/revoke")
    def revoke_token(here: Here, token_id: str) -> Response:
        revoke_api_token(parts, here, token_id)
        return _to("/desk/tokens")

    @router.get("/audit")
    def audit(request: Request) -> Response:
        page = number_in({"page": [request.query_params.get("page", "0")]}, "page") or 0
        about = request.query_params.get("about") or None
        entries = kept.audit(_AUDIT_PAGE + 1, page * _AUDIT_PAGE, about)
        context = {
            "entries": entries[:_AUDIT_PAGE],
            "about": about,
            "newer": str(page - 1) if page else None,
            "older": str(page + 1) if len(entries) > _AUDIT_PAGE else None,
        }
        return desk_page(request, "audit.html", context)

    return router


def _role(form: Fields) -> Role:
    try:
        return Role(only(form, "role"))
    except ValueError as error:
        raise ImpossibleRoleError("Expected a role: owner, assistant or viewer.") from error


def _to(path: str) -> Response:
    return RedirectResponse(path, status_code=303)
