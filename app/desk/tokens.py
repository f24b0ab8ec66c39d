"""Programs' tokens: who may make and revoke which."""

from __future__ import annotations

from app.desk.admission import Admitted, NotAllowedError
from app.desk.parts import DeskParts
from app.services.desk_accounts import DeskAccounts
from app.store import ApiToken, Role, UnknownError


def make_api_token(accounts: DeskAccounts, here: Admitted, label: str, role: Role) -> tuple[ApiToken, str]:
    """Lets a program in for somebody; returns its token and the secret.

    Raises:
        NotAllowedError: A program asks, whose own token would outlive its being revoked.
        ImpossibleNameError: See `DeskAccounts.add_token`.
    """
    if here.is_program:
        raise NotAllowedError("A program can’t let in another one. Make the token at the desk.")
    return accounts.add_token(here.experimenter, label, role)


def revoke_api_token(parts: DeskParts, here: Admitted, token_id: str) -> None:
    """Shuts a program out: one's own, or anybody's for an owner.

    Raises:
        UnknownError: There is no such token, or it is somebody else's.
    """
    theirs = parts.runtime.store.desk.api_tokens(None if here.is_owner else here.name)
    if token_id not in [token.id for token in theirs]:
        raise UnknownError(f"Expected the id of a token of yours, got '{token_id}'.")
    parts.accounts.revoke_token(here.name, token_id)
