"""Secrets of participants, of which only hashes are kept: the token in a session's address, and the code to resume it.

A code is a function of the token, so that whoever has the token can be shown it again, and nobody else. It has 60 bits,
against 128 of the token, because people copy it by hand; it opens nothing by itself, but gets a session another token,
at a bounded rate.
"""

from __future__ import annotations

import base64
import hashlib
import re
import secrets

# Crockford's: no I, L, O and U, which a hand writes like 1, 1, 0 and V.
_ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_READ_AS = str.maketrans({"I": "1", "L": "1", "O": "0"})
_CODE_LENGTH = 12
_GROUP = 4
_TOKEN = re.compile(r"[A-Za-z0-9_-]{22}")


def new_token() -> str:
    """Returns a fresh secret of 128 bits, safe in a URL."""
    return secrets.token_urlsafe(16)


def is_token(text: str) -> bool:
    """Returns whether a text has the form of a token."""
    return _TOKEN.fullmatch(text) is not None


def hash_token(token: str) -> str:
    """Returns what is stored and looked up instead of the token; 128 random bits need no salt."""
    return hashlib.sha256(token.encode()).hexdigest()


def next_token(token: str) -> str:
    """Returns the token of the session that takes the place of a token's own: the same whenever it is asked for."""
    digest = hashlib.sha256(b"next " + token.encode()).digest()
    return base64.urlsafe_b64encode(digest[:16]).decode().rstrip("=")


def resume_code(token: str) -> str:
    """Returns the code that belongs to a token, such as `7KQF-3MXP-9RTW`."""
    number = int.from_bytes(hashlib.sha256(b"resume " + token.encode()).digest())
    code = "".join(_ALPHABET[number >> 5 * i & 31] for i in range(_CODE_LENGTH))
    return "-".join(code[i : i + _GROUP] for i in range(0, _CODE_LENGTH, _GROUP))


def hash_code(code: str) -> str:
    """Returns what is stored and looked up instead of a code, however a person has typed it."""
    read = re.sub(r"[\s-]", "", code.upper()).translate(_READ_AS)
    return hashlib.sha256(b"resume code " + read.encode()).hexdigest()
