"""Who may use the desk: accounts, logins and programs' tokens. Everything that changes something is in the audit."""

from __future__ import annotations

import hmac
import re
from datetime import UTC, datetime, timedelta

from app.errors import AppError
from app.services.passwords import hash_password, is_right, new_password
from app.services.slowdown import Slowdown
from app.services.tokens import hash_code, hash_token, new_token, resume_code
from app.store import ApiToken, Experimenter, Role, Store

IDLE = timedelta(hours=12)
"""A login ends when nothing was done with it for so long."""
LONGEST = timedelta(days=7)
"""A login ends in any case after so long."""

LONGEST_LABEL = 100

COMMAND_LINE = "command line"
"""Who has done it, in the audit, where it wasn't done at the desk."""

# Whoever shares an address with others, in a laboratory, is not held up by a few of their mistakes.
_FREE_TRIES_OF_A_NAME, _LONGEST_WAIT_OF_A_NAME_S = 3, 30.0
_FREE_TRIES_OF_AN_ADDRESS, _LONGEST_WAIT_OF_AN_ADDRESS_S = 10, 300.0
_SET_UP = "set-up"
# Names are parts of addresses.
_NAME = re.compile(r"\w[\w.@+ -]{0,63}")


class WrongPasswordError(AppError):
    """Name and password don't belong together; whether there is such a name isn't told."""


class WrongCodeError(AppError):
    """Not the set-up code that the server has printed."""


class TooManyTriesError(AppError):
    """Several wrong passwords in a row.

    Attributes:
        wait_s: After so many seconds the next try is looked at.
    """

    def __init__(self, wait_s: int) -> None:
        super().__init__(
            f"Several tries were wrong. Please wait {wait_s} {'second' if wait_s == 1 else 'seconds'}, then try again."
        )
        self.wait_s = wait_s


class ImpossibleNameError(AppError):
    """A name that can't be somebody's, or a label that can't be a token's."""


class DeskAccounts:
    """Lets experimenters and their programs in. Fit for many threads.

    Attributes:
        setup_code: What makes the first owner, known to whoever has started the server; None where there is one.
    """

    def __init__(self, store: Store) -> None:
        """Looks whether there is an owner.

        Args:
            store: Where accounts are kept.
        """
        self._store, self._desk = store, store.desk
        self._names = Slowdown(_FREE_TRIES_OF_A_NAME, _LONGEST_WAIT_OF_A_NAME_S)
        self._addresses = Slowdown(_FREE_TRIES_OF_AN_ADDRESS, _LONGEST_WAIT_OF_AN_ADDRESS_S)
        self.setup_code = None if self._desk.experimenters() else resume_code(new_token())

    @property
    def needs_owner(self) -> bool:
        """Returns whether nobody may use the desk yet."""
        return not self._desk.experimenters()

    def set_up(self, code: str, name: str, password: str, address: str) -> str:
        """Makes the first owner and logs them in.

        Args:
            code: The set-up code, however it was typed.
            name: What they will log in with.
            password: Theirs.
            address: Where the request comes from.

        Returns:
            The secret of their login.

        Raises:
            WrongCodeError: It is another code.
            TooManyTriesError: Too many codes were wrong.
            ExperimenterKnownError: There is an owner already.
            ImpossibleNameError: See `add`, as for WeakPasswordError.
        """
        self._require_patience(_SET_UP, address)
        if self.setup_code is None or not hmac.compare_digest(hash_code(code), hash_code(self.setup_code)):
            self._count_failure(_SET_UP, address)
            raise WrongCodeError("This is not the set-up code. The server printed it when it was started.")
        self.add(name, name, password, Role.OWNER, is_first=True)
        return self._begin(name.strip())

    def log_in(self, name: str, password: str, address: str) -> str:
        """Logs somebody in.

        Args:
            name: Theirs.
            password: Theirs.
            address: Where the request comes from.

        Returns:
            The secret of the login.

        Raises:
            TooManyTriesError: Too many tries for this name, or from this address, were wrong; this one isn't looked at.
            WrongPasswordError: Name and password don't belong together.
        """
        name = name.strip()
        self._require_patience(name, address)
        if not is_right(password, self._desk.password_hash(name)):
            self._count_failure(name, address)
            raise WrongPasswordError("Name and password don’t belong together.")
        self._names.succeeded(name)
        return self._begin(name)

    def log_out(self, token: str) -> None:
        """Ends a login."""
        self._desk.end_login(hash_token(token))

    def experimenter(self, token: str, is_active: bool = True) -> Experimenter | None:
        """Returns who is logged in with a secret; None if nobody is any more.

        Args:
            token: The secret.
            is_active: Whether the experimenter has done something; pages that keep themselves up to date don't count.
        """
        now = datetime.now(UTC)
        return self._desk.login(hash_token(token), now - IDLE, now - LONGEST, is_active)

    def program(self, token: str) -> Experimenter | None:
        """Returns for whom a program acts that has this secret, with the role that it has; None if it has none."""
        return self._desk.program(hash_token(token))

    def add(self, who: str, name: str, password: str, role: Role, is_first: bool = False) -> Experimenter:
        """Lets somebody use the desk.

        Args:
            who: Name of whoever lets them.
            name: What they will log in with.
            password: Theirs.
            role: What they may do.
            is_first: Whether it is refused where there is anybody already.

        Raises:
            ImpossibleNameError: It can't be a name.
            WeakPasswordError: The password is too short or too long.
            ExperimenterKnownError: There is somebody of that name.
        """
        name = name.strip()
        if not _NAME.fullmatch(name):
            raise ImpossibleNameError(
                "Expected a name of 1 to 64 letters, digits, spaces or . _ @ + -, which begins with one of the first "
                f"two; got {name[:80]!r}."
            )
        added = self._desk.add_experimenter(name, hash_password(password), role, is_first)
        self._desk.record(who.strip(), "account_added", name, {"role": role.value})
        return added

    def change_role(self, who: str, name: str, role: Role) -> None:
        """Changes what somebody may do.

        Raises:
            StoreError: There is nobody of that name, or no other owner.
        """
        self._desk.change_role(name, role)
        self._desk.record(who, "role_changed", name, {"role": role.value})

    def remove(self, who: str, name: str) -> None:
        """Takes the desk from somebody.

        Raises:
            StoreError: There is nobody of that name, or no other owner.
        """
        self._desk.remove_experimenter(name)
        self._desk.record(who, "account_removed", name)

    def reset_password(self, who: str, name: str, password: str | None = None) -> str:
        """Gives somebody another password, and logs them out everywhere.

        Args:
            who: Name of whoever does it.
            name: Whose.
            password: The new one; a random one unless told.

        Returns:
            The new password.

        Raises:
            StoreError: There is nobody of that name.
            WeakPasswordError: The password is too short or too long.
        """
        password = password or new_password()
        self._desk.change_password(name, hash_password(password))
        self._desk.record(who, "password_reset", name)
        return password

    def change_password(self, name: str, old: str, new: str, address: str) -> str:
        """Lets somebody change their own password; logs them out everywhere and in again here.

        Returns:
            The secret of the new login.

        Raises:
            TooManyTriesError: See `log_in`, as for WrongPasswordError.
            WeakPasswordError: The new password is too short or too long.
        """
        self.log_out(self.log_in(name, old, address))
        self._desk.change_password(name, hash_password(new))
        self._desk.record(name, "password_changed", name)
        return self._begin(name)

    def add_token(self, owner: Experimenter, label: str, role: Role) -> tuple[ApiToken, str]:
        """Lets a program of somebody's in.

        Args:
            owner: Whose it is.
            label: What they call it.
            role: What it may do; it never gets more than they may.

        Returns:
            The token as it is listed, and its secret, which is told this once.

        Raises:
            ImpossibleNameError: The label isn't 1 to 100 printable characters, or the role more than they have.
        """
        label = label.strip()
        if not 0 < len(label) <= LONGEST_LABEL or not label.isprintable():
            raise ImpossibleNameError(
                f"Expected a label of 1 to {LONGEST_LABEL} printable characters, got {label[:80]!r}."
            )
        if not owner.role.may_act_as(role):
            raise ImpossibleNameError(
                f"Expected a role of at most {owner.role.value}, got {role.value}. A program gets no more than you."
            )
        secret = new_token()
        token = self._desk.add_api_token(owner.name, label, role, hash_token(secret))
        self._desk.record(owner.name, "token_made", token.id, {"label": label, "role": role.value})
        return token, secret

    def revoke_token(self, who: str, token_id: str) -> None:
        """Shuts a program out.

        Raises:
            StoreError: There is no such token.
        """
        self._desk.revoke_api_token(token_id)
        self._desk.record(who, "token_revoked", token_id)

    def _begin(self, name: str) -> str:
        token = new_token()
        self._desk.begin_login(name, hash_token(token))
        self._desk.record(name, "logged_in", name)
        return token

    def _require_patience(self, name: str, address: str) -> None:
        wait_s = max(self._names.wait_s(name), self._addresses.wait_s(address))
        if wait_s:
            raise TooManyTriesError(wait_s)

    def _count_failure(self, name: str, address: str) -> None:
        self._names.failed(name)
        self._addresses.failed(address)
