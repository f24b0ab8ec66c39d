"""Passwords: never kept, only their Argon2id hashes; and never told apart by the time that a look takes."""

from __future__ import annotations

import threading
import unicodedata
from functools import cache
from secrets import token_urlsafe

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from app.errors import AppError

SHORTEST, LONGEST = 10, 200
"""Characters of a password."""

_HASHER = PasswordHasher()
# Each takes 64 MiB and all of a core for a moment; whoever tries many gets no more than one.
_ONE_AT_A_TIME = threading.Lock()


class WeakPasswordError(AppError):
    """A password that is too short, or too long to be typed."""


def hash_password(password: str) -> str:
    """Returns what is stored of a password.

    Raises:
        WeakPasswordError: It hasn't `SHORTEST` to `LONGEST` characters.
    """
    if not SHORTEST <= len(password) <= LONGEST:
        raise WeakPasswordError(
            f"Expected a password of {SHORTEST} to {LONGEST} characters, got {len(password)}. Three words will do."
        )
    with _ONE_AT_A_TIME:
        return _HASHER.hash(_normal(password))


def is_right(password: str, stored: str | None) -> bool:
    """Returns whether a password is the stored one; without a stored one it takes as long to say no."""
    with _ONE_AT_A_TIME:
        try:
            _HASHER.verify(stored or _nobodys(), _normal(password[:LONGEST]))
        except (VerificationError, InvalidHashError):
            return False
    return stored is not None


def new_password() -> str:
    """Returns a password of 96 random bits, to be told once."""
    return token_urlsafe(12)


def _normal(password: str) -> str:
    """Returns a password as it is hashed: keyboards write the same letter in several ways."""
    return unicodedata.normalize("NFKC", password)


@cache
def _nobodys() -> str:
    return _HASHER.hash(token_urlsafe(32))
